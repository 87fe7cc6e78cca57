// Runs Python files in MicroPython: node micropython.mjs MAIN.py OTHER.py ...; the others can be imported.
import fs from "node:fs";
import path from "node:path";
import { loadMicroPython } from "@micropython/micropython-webassembly-pyscript/micropython.mjs";

const files = process.argv.slice(2);
const mp = await loadMicroPython({ heapsize: 8 << 20, linebuffer: true, stdout: (line) => console.log(line) });
for (const file of files) {
    mp.FS.writeFile(path.basename(file), fs.readFileSync(file));
}
try {
    mp.runPython(fs.readFileSync(files[0], "utf8"));
} catch (error) {
    console.error(error.message);
    process.exitCode = 1;
}
