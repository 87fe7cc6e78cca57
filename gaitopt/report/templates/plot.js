// Figures: the value under the pointer, a part larger, curves off and on. A figure without this script is whole.
(() => {
  "use strict";
  const svg = (tag, more) => {
    const made = document.createElementNS(document.querySelector("figure.plot svg").namespaceURI, tag);
    for (const [key, value] of Object.entries(more)) made.setAttribute(key, value);
    return made;
  };
  const html = (tag, more) => Object.assign(document.createElement(tag), more);
  const shown = (value) => Number(value.toPrecision(4)).toString().replace("-", "−");

  // --- an axis: places in the figure, and values ---------------------------------------------
  const axisOf = (text, from, to) => {
    const [low, high, scale] = text.split(" ");
    const log = scale === "log";
    const [a, b] = [low, high].map((end) => (log ? Math.log10(end) : Number(end)));
    const value = (at) => { const v = a + ((b - a) * (at - from)) / (to - from); return log ? 10 ** v : v; };
    const place = (v) => from + (((log ? Math.log10(v) : v) - a) / (b - a)) * (to - from);
    return { log, value, place };
  };
  const ticks = (one, other, log) => {
    const [low, high] = one < other ? [one, other] : [other, one];
    const found = [];
    if (log && high / low > 8) {
      for (let ten = Math.floor(Math.log10(low)); ten <= Math.log10(high); ten += 1)
        for (const first of high / low > 300 ? [1] : [1, 2, 5]) found.push(first * 10 ** ten);
    } else {
      const rough = (high - low) / 5, ten = 10 ** Math.floor(Math.log10(rough));
      const step = ten * [1, 2, 5, 10].find((times) => times * ten >= rough * 0.999);
      for (let n = Math.ceil(low / step); n * step <= high; n += 1) found.push(n * step);
    }
    return found.filter((value) => value >= low && value <= high);
  };

  // --- a panel: what is in it, where that was, which part is seen --------------------------------
  const panelOf = (group) => {
    const [x0, y0, x1, y1] = group.dataset.box.split(" ").map(Number);
    const [xName, yName] = group.dataset.names.split("|");
    const panel = { group, x0, y0, x1, y1, xName, yName, x: axisOf(group.dataset.x, x0, x1), y: axisOf(group.dataset.y, y0, y1),
      shared: group.dataset.shared, view: { x0, y0, x1, y1 }, pieces: [], rows: [] };
    for (const element of group.querySelectorAll("path, use, text")) {
      if (element.closest("defs, .axis") || !element.closest(element.tagName === "text" ? ".placed" : "[clip-path]")) continue;
      const d = element.getAttribute("d"), at = [];
      const words = d?.match(/[A-Za-z]|-?[\d.]+/g) ?? [];
      if (d) {
        const flat = words.filter((one) => !/[A-Za-z]/.test(one)).map(Number);
        for (let n = 0; n + 1 < flat.length; n += 2) at.push([flat[n], flat[n + 1]]);
      } else at.push(["x", "y"].map((key) => Number(element.getAttribute(key) ?? 0)));
      panel.pieces.push({ element, at, words, series: element.closest("[data-series]"), closed: !!d && /z/i.test(d) });
    }
    for (const tick of group.dataset.rows ? group.querySelectorAll(".tick.y") : [])
      panel.rows.push({ y: Number(tick.querySelector("use")?.getAttribute("y")), name: tick.textContent.trim() });
    return panel;
  };
  const mapping = ({ x0, y0, x1, y1, view: v }) => ([x, y]) =>
    [x0 + ((x - v.x0) * (x1 - x0)) / (v.x1 - v.x0), y0 + ((y - v.y0) * (y1 - y0)) / (v.y1 - v.y0)];
  const unmapped = ({ x0, y0, x1, y1, view: v }, [x, y]) =>
    [v.x0 + ((x - x0) * (v.x1 - v.x0)) / (x1 - x0), v.y0 + ((y - y0) * (v.y1 - v.y0)) / (y1 - y0)];
  // The part of a panel between two places, in rising order.
  const between = ({ x0, y0, x1, y1 }, from, to) => {
    const rising = (one, other) => (one < other ? [one, other] : [other, one]);
    return [rising(from[0], Math.max(x0, Math.min(x1, to[0]))), rising(from[1], Math.max(y1, Math.min(y0, to[1])))];
  };
  const namesOf = (root) => new Map([...root.querySelectorAll("[data-entry] text")].map((text) =>
    [text.closest("[data-entry]").dataset.entry, text.textContent.trim()]));
  // What a bar says: its length from 0, or its own length where it floats.
  const barred = (low, high) => {
    if (Math.abs(low) > Math.abs(high) && high <= 1e-9) return low;
    return low > 1e-9 ? high - low : high;
  };
  const within = (panel, [x, y], slack = 1) =>
    x >= panel.x0 - slack && x <= panel.x1 + slack && y <= panel.y0 + slack && y >= panel.y1 - slack;

  const redraw = (panel) => {
    const to = mapping(panel);
    for (const { element, at, words } of panel.pieces) {
      if (words.length) {
        let n = 0;
        const flat = at.flatMap(to);
        element.setAttribute("d", words.map((one) => (/[A-Za-z]/.test(one) ? one : flat[n++].toFixed(2))).join(" "));
      } else if (element.tagName === "text") {
        const [x, y] = to(at[0]);
        element.setAttribute("transform", `translate(${x - at[0][0]} ${y - at[0][1]})`);
        element.classList.toggle("gone", !within(panel, [x, y], 6));
      } else ["x", "y"].forEach((key, n) => element.setAttribute(key, to(at[0])[n].toFixed(2)));
    }
    redrawTicks(panel, "x");
    if (!panel.rows.length) return redrawTicks(panel, "y");
    panel.group.querySelectorAll(".tick.y").forEach((tick, n) => {
      const y = to([0, panel.rows[n].y])[1];
      tick.setAttribute("transform", `translate(0 ${y - panel.rows[n].y})`);
      tick.classList.toggle("gone", !within(panel, [panel.x0, y]));
    });
  };
  const redrawTicks = (panel, key) => {
    const old = [...panel.group.querySelectorAll(`.tick.${key}`)];
    panel[`own-${key}`]?.remove();
    const { view: v } = panel;
    const whole = key === "x" ? v.x0 === panel.x0 && v.x1 === panel.x1 : v.y0 === panel.y0 && v.y1 === panel.y1;
    for (const one of old) one.classList.toggle("gone", !whole);
    const like = old.map((one) => one.querySelector("text")).find((text) => text?.textContent);
    if (whole) return;
    const axis = panel[key], own = svg("g", { class: "axis" });
    for (const value of ticks(axis.value(v[`${key}0`]), axis.value(v[`${key}1`]), axis.log)) {
      const at = mapping(panel)(key === "x" ? [axis.place(value), 0] : [0, axis.place(value)])[key === "x" ? 0 : 1];
      const d = key === "x" ? `M ${at} ${panel.y0} V ${panel.y1}` : `M ${panel.x0} ${at} H ${panel.x1}`;
      own.append(svg("path", { d, style: "fill: none; stroke: var(--line); stroke-width: 0.6" }));
      if (!like) continue;
      const text = svg("text", { style: like.getAttribute("style") });
      text.style.textAnchor = key === "x" ? "middle" : "end";
      text.setAttribute("x", key === "x" ? at : panel.x0 - 7);
      text.setAttribute("y", key === "x" ? like.getAttribute("y") : at + 3.5);
      text.textContent = shown(value);
      own.append(text);
    }
    panel[`own-${key}`] = own;
    panel.group.insertBefore(own, panel.group.querySelector(".axis").nextSibling);
  };

  // --- what is nearest to a place ------------------------------------------------------------
  const nearest = (panel, [px, py]) => {
    let best = null;
    const to = mapping(panel);
    const offer = (far, [x, y], piece, length) => {
      if (far < (best?.far ?? 24)) best = { far, at: [x, y], piece, length };
    };
    for (const piece of panel.pieces) {
      if (piece.element.tagName === "text" || piece.series?.classList.contains("off")) continue;
      const at = piece.at.map(to);
      if (piece.closed) {
        const xs = at.map(([x]) => x), ys = at.map(([, y]) => y);
        const [left, right, top, bottom] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
        const inside = px >= left && px <= right && py >= top && py <= bottom;
        const shade = !panel.rows.length;  // a span of time or a floor, not a bar
        if (inside) offer(shade ? 20 : 6, shade ? [px, py] : [right, (top + bottom) / 2], piece, [left, right]);
      } else if (at.length === 1) offer(Math.hypot(at[0][0] - px, at[0][1] - py), at[0], piece);
      else for (let n = 0; n + 1 < at.length; n += 1) {
        const [[ax, ay], [bx, by]] = [at[n], at[n + 1]], dx = bx - ax, dy = by - ay;
        const share = Math.max(0, Math.min(1, ((px - ax) * dx + (py - ay) * dy) / (dx * dx + dy * dy || 1)));
        const spot = [ax + share * dx, ay + share * dy];
        offer(Math.hypot(spot[0] - px, spot[1] - py), spot, piece);
      }
    }
    return best;
  };
  const inWords = (panel, { at, piece, length }, names) => {
    const [x, y] = unmapped(panel, at);
    const lines = [names.get(piece.series?.dataset.series) ?? ""];
    if (panel.rows.length) {
      const row = panel.rows.reduce((a, b) => (Math.abs(b.y - y) < Math.abs(a.y - y) ? b : a));
      const ends = length?.map((end) => panel.x.value(unmapped(panel, [end, 0])[0])) ?? [0, panel.x.value(x)];
      lines.push(row.name, `${panel.xName}: ${shown(barred(...ends))}`);
    } else {
      if (!piece.closed) lines.push(`${panel.yName}: ${shown(panel.y.value(y))}`);
      lines.push(`${panel.xName}: ${shown(panel.x.value(x))}`);
    }
    return lines.filter(Boolean);
  };

  // --- one drawing: pointer and zoom -----------------------------------------------------------
  const drawingOf = (root, figure, tip) => {
    const panels = [...root.querySelectorAll(".panel")].map((group) => panelOf(group));
    const names = namesOf(root);
    const spot = svg("circle", { r: 4, class: "spot gone" });
    root.append(spot);
    let down = null, frame = null, last = panels[0];
    const placeOf = (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(root.getScreenCTM().inverse());
      return [at.x, at.y];
    };
    const show = (panel, view) => {
      for (const one of panels) {
        if (one !== panel && one.shared !== panel.shared) continue;
        one.view = one === panel ? view : { ...one.view, x0: view.x0, x1: view.x1 };
        redraw(one);
      }
      hide();
    };
    const hide = () => { tip.hidden = true; spot.classList.add("gone"); };
    const zoom = (factor, [cx, cy] = []) => {
      const p = last, v = p.view, kept = (low, high, from, to, centre) => {
        const half = ((high - low) / factor) / 2, middle = centre ?? (low + high) / 2;
        if (Math.abs(2 * half) >= Math.abs(to - from)) return [from, to];
        const sign = Math.sign(to - from), least = sign > 0 ? from : to, most = sign > 0 ? to : from;
        const begin = Math.max(least, Math.min(most - 2 * Math.abs(half), middle - Math.abs(half)));
        return sign > 0 ? [begin, begin + 2 * Math.abs(half)] : [begin + 2 * Math.abs(half), begin];
      };
      const [x0, x1] = kept(v.x0, v.x1, p.x0, p.x1, cx), [y0, y1] = kept(v.y0, v.y1, p.y0, p.y1, cy);
      show(p, { x0, x1, y0, y1 });
    };
    const whole = () => { for (const one of panels) show(one, { x0: one.x0, y0: one.y0, x1: one.x1, y1: one.y1 }); };
    root.addEventListener("pointermove", (event) => {
      const at = placeOf(event), panel = down?.panel ?? panels.find((one) => within(one, at));
      if (!panel) return hide();
      last = panel;
      if (down) {
        const [[ax, bx], [ay, by]] = between(panel, down.at, at);
        frame ??= root.appendChild(svg("rect", { class: "drag" }));
        for (const [key, value] of Object.entries({ x: ax, y: ay, width: bx - ax, height: by - ay })) frame.setAttribute(key, value);
        return hide();
      }
      const found = nearest(panel, at);
      if (!found) return hide();
      tip.replaceChildren(...inWords(panel, found, names).map((line) => html("div", { textContent: line })));
      tip.hidden = false;
      const box = figure.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
      tip.style.left = `${Math.max(0, Math.min(x + 14, box.width - tip.offsetWidth))}px`;
      tip.style.top = `${Math.max(0, y - tip.offsetHeight - 14)}px`;
      spot.setAttribute("cx", found.at[0]);
      spot.setAttribute("cy", found.at[1]);
      spot.classList.remove("gone");
    });
    root.addEventListener("pointerdown", (event) => {
      const at = placeOf(event), panel = panels.find((one) => within(one, at));
      if (!panel || event.button || event.pointerType === "touch") return;
      down = { at, panel };
      root.setPointerCapture(event.pointerId);
      event.preventDefault();
    });
    const up = (event) => {
      const begun = down;
      frame?.remove();
      frame = down = null;
      if (!begun || event.type !== "pointerup") return;
      const p = begun.panel, [[ax, bx], [ay, by]] = between(p, begun.at, placeOf(event));
      if (bx - ax < 5 && by - ay < 5) return;
      const flat = by - ay < 12, thin = bx - ax < 12;  // along one axis only
      const [x0, y0] = unmapped(p, [thin ? p.x0 : ax, flat ? p.y0 : by]), [x1, y1] = unmapped(p, [thin ? p.x1 : bx, flat ? p.y1 : ay]);
      show(p, { x0, y0, x1, y1 });
    };
    for (const name of ["pointerup", "pointercancel"]) root.addEventListener(name, up);
    root.addEventListener("pointerleave", () => { if (!down) hide(); });
    root.addEventListener("dblclick", whole);
    return { zoom, whole };
  };

  // --- one figure: its drawings, its curves and its buttons ------------------------------------------
  document.querySelectorAll("figure.plot").forEach((figure) => {
    const roots = [...figure.querySelectorAll("svg")].filter((root) => root.querySelector(".panel"));
    if (!roots.length) return;
    const tip = html("div", { className: "tip", hidden: true });
    figure.append(tip);
    const made = new Map();
    const drawn = (root) => made.get(root) ?? made.set(root, drawingOf(root, figure, tip)).get(root);
    const current = () => drawn(roots.find((root) => root.getClientRects().length) ?? roots[0]);
    for (const root of roots) root.addEventListener("pointerover", () => drawn(root), { once: true });

    const tools = html("details", { className: "tools" }), row = html("div", { className: "row" });
    tools.append(html("summary", { textContent: "Zoom and curves" }), row);
    const button = (textContent, act) => {
      const one = html("button", { type: "button", textContent });
      one.addEventListener("click", () => act(one));
      row.append(one);
      return one;
    };
    button("Zoom in", () => current().zoom(2));
    button("Zoom out", () => current().zoom(0.5));
    button("Whole figure", () => current().whole());
    const flip = (number, one) => {
      const off = one.getAttribute("aria-pressed") === "true";
      one.setAttribute("aria-pressed", String(!off));
      for (const root of roots)
        for (const part of root.querySelectorAll(`[data-series="${number}"], [data-entry="${number}"]`)) part.classList.toggle("off", off);
    };
    for (const [number, name] of namesOf(roots[0])) {
      if (!roots[0].querySelector(`[data-series="${number}"]`)) continue;
      const one = button(name, () => flip(number, one));
      one.setAttribute("aria-pressed", "true");
      for (const root of roots)
        for (const part of root.querySelectorAll(`[data-entry="${number}"]`)) part.addEventListener("click", () => flip(number, one));
    }
    figure.insertBefore(tools, figure.querySelector("figcaption"));
  });
})();
