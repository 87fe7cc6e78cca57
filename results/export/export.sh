#!/usr/bin/env bash
# Exports the four baselines of problems/arcfold, and the best gait of a run folder if one is named:
#
#     results/export/export.sh                                # as C and as MicroPython
#     FORMATS="c arduino esp-idf micropython csv json" results/export/export.sh
#     RUN=results/reference results/export/export.sh          # and its optimised gait
set -euo pipefail
cd "$(dirname "$0")/../.."

for gait in square-4s square-2s square-1s square-0.5s ${RUN:+"$RUN"}; do
  name=$([ "$gait" = "${RUN:-}" ] && echo optimised || echo "$gait")
  for format in ${FORMATS:-c micropython}; do
    echo "== $name, $format"
    rm -rf "results/export/$name/$format"
    gaitopt export problems/arcfold "$gait" --format "$format" --led-pin 2 --out "results/export/$name/$format"
  done
done
