// Asks for the figures of the run again and again, and draws them; texts from files are only texts.
(() => {
  "use strict";
  const at = (id) => document.getElementById(id);
  const svg = (tag, attributes, text = "") => {
    const one = document.createElementNS("http://www.w3.org/2000/svg", tag);
    for (const [name, value] of Object.entries(attributes)) one.setAttribute(name, value);
    one.textContent = text;
    return one;
  };
  const speed = (gait) => `${gait.speed_mm_s.toFixed(1)} mm/s`;

  const draw = (now) => {
    const narrow = innerWidth < 640;
    const [width, height, left, below] = narrow ? [360, 300, 46, 34] : [900, 420, 52, 36];
    const shown = now.gaits.filter((gait) => gait.speed_mm_s !== null);
    const better = now.improvements.filter((gait) => gait.speed_mm_s !== null);
    const speeds = [0, ...shown.map((g) => g.speed_mm_s), ...better.map((g) => g.speed_mm_s)];
    const low = Math.max(Math.min(...speeds), -Math.max(...speeds, 1) / 2);
    const high = Math.max(...speeds, 1) * 1.05;
    const x = (number) => left + ((width - left - 10) * number) / Math.max(now.budget, now.evaluations, 1);
    const y = (value) => 10 + ((height - below - 10) * (high - Math.max(value, low))) / (high - low);
    const step = 10 ** Math.floor(Math.log10(high)) / (high / 10 ** Math.floor(Math.log10(high)) < 3 ? 2 : 1);
    const picture = svg("svg", { viewBox: `0 0 ${width} ${height}`, "aria-hidden": "true" });
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      picture.append(svg("line", { class: "grid", x1: left, x2: width - 10, y1: y(value), y2: y(value) }));
      picture.append(svg("text", { x: left - 6, y: y(value) + 4, "text-anchor": "end" }, String(Number(value.toPrecision(6)))));
    }
    picture.append(svg("path", { class: "axis", d: `M${left} 10V${height - below}H${width - 10}` }));
    for (const share of [0, 0.5, 1]) {
      const number = Math.round(share * Math.max(now.budget, now.evaluations));
      const anchor = ["start", "middle", "end"][share * 2];
      picture.append(svg("text", { x: x(number), y: height - below + 16, "text-anchor": anchor }, String(number)));
    }
    picture.append(svg("text", { x: (width + left) / 2, y: height - 3, "text-anchor": "middle" }, "gaits evaluated; speed in mm/s"));
    for (const gait of shown) {
      const kind = !gait.working ? "cheap" : gait.limits_kept ? "kept" : "broken";
      picture.append(svg("circle", { class: kind, cx: x(gait.gait), cy: y(gait.speed_mm_s), r: 2.5 }));
    }
    if (better.length) {
      let path = `M${x(better[0].gait)} ${y(better[0].speed_mm_s)}`;
      for (const gait of better.slice(1)) path += `H${x(gait.gait)}V${y(gait.speed_mm_s)}`;
      picture.append(svg("path", { class: "bestline", d: `${path}H${x(now.evaluations)}` }));
    }
    at("plot").replaceChildren(picture);
    const best = now.best?.speed_mm_s != null ? `: ${speed(now.best)}, gait ${now.best.gait}` : "";
    at("plot").setAttribute("aria-label", `Forward speed of ${now.evaluations} gaits so far, and of the best one${best}`);
  };

  const say = (now) => {
    at("count").textContent = `${now.evaluations} of ${now.budget}`;
    at("progress").value = now.evaluations;
    const best = now.best?.speed_mm_s != null
      ? `Best so far: ${speed(now.best)} (gait ${now.best.gait}, ${now.best.limits_kept ? "keeps all limits" : "breaks a limit"}).`
      : "No gait was judged at the working fidelity yet.";
    const verifying = now.state === "running" && now.evaluations >= now.budget;
    const last = { finished: " The run is finished.", interrupted: " The run was stopped; it can go on with --resume." };
    if (now.evaluations || now.state !== "running")
      at("answer").textContent = best + (verifying ? " The best gaits are being verified." : last[now.state] ?? "");
  };

  let before = "";
  const ask = async () => {
    try {
      const text = await (await fetch("state.json")).text();
      const now = JSON.parse(text);
      if (text !== before) { say(now); draw(now); before = text; }
      if (now.state === "finished") return location.replace("report.html");
      if (now.state !== "running") return undefined;
    } catch {
      at("answer").textContent += " gaitopt watch has ended.";
      return undefined;
    }
    return setTimeout(ask, Number(document.body.dataset.every));
  };
  ask();
})();
