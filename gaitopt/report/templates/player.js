// The player: plays the motions of a page on one clock, one or two at once. It needs player-scene.js.
(() => {
  "use strict";
  const {unpacked, turns, bytes} = gaitoptNumbers, vectors = gaitoptVectors;
  const {add, dot, cross, unit} = vectors;
  const COLOURS = {touch: [1, 0.69, 0, 1], marker: [0.84, 0.37, 0, 1], measured: [0, 0.45, 0.7, 1]};
  const LOOKS = {
    light: {background: [0.945, 0.953, 0.965], ground: [1, 1, 0.99, 1], lines: [0.5, 0.55, 0.62, 0.45], shadow: 0.2},
    dark: {background: [0.075, 0.09, 0.115], ground: [0.16, 0.18, 0.21, 1], lines: [0.62, 0.68, 0.75, 0.35], shadow: 0.45},
  };
  const VIEW = 30 * Math.PI / 180;
  const VIEWS = {side: [-75, 20], above: [-90, 89.5], front: [20, 12]};  // degrees about up from forward, above level
  const round = x => { const p = 10 ** Math.floor(Math.log10(x)); return p * (x >= 5 * p ? 5 : x >= 2 * p ? 2 : 1); };
  const length = m => {
    const mm = Math.abs(m) < 0.1 ? (1e3 * m).toFixed(1) : (1e3 * m).toFixed(0);
    return `${Number(mm) || 0} mm`.replace("-", "−");
  };
  const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

  // A motion: where each body is at any time.
  function motion(take, robot) {
    const at = unpacked(take.positions), turn = turns(take.turns), touch = bytes(take.touching);
    const path = unpacked(take.path), marker = take.marker && unpacked(take.marker);
    const bodies = robot.bodies, wide = Math.ceil(robot.shapes.length / 8), last = take.moments - 1;
    const when = t => {
      const f = Math.min(Math.max((t - take.begin_s) / take.step_s || 0, 0), last), i = Math.min(Math.floor(f), last);
      return [i, Math.min(i + 1, last), f - i];
    };
    const row = (values, i, n) => Array.from(values.subarray(n * i, n * i + n));
    const between = (values, n, [i, j, s]) => { const b = row(values, j, n); return row(values, i, n).map((x, k) => x + s * (b[k] - x)); };
    const measured = take.measured && {time: unpacked(take.measured.time), at: unpacked(take.measured.positions)};
    return {
      take, robot, marker, path, measured, end: take.begin_s + last * take.step_s, row, when,
      placed: t => {
        const [i, j, s] = when(t);
        return Array.from({length: bodies}, (_, b) => vectors.placed(
          between(at, 3, [i * bodies + b, j * bodies + b, s]), between(turn, 4, [i * bodies + b, j * bodies + b, s])));
      },
      touching: t => { const i = Math.round(when(t)[0]); return n => (touch[wide * i + (n >> 3)] >> (n & 7)) & 1; },
      followed: t => between(path, 3, when(t)),
      marked: t => marker && between(marker, 3, when(t)),
      body: (i, b) => row(at, i * bodies + b, 3),
    };
  }

  // How far the robot reaches from where the camera looks, and where its way lies, m.
  function extent(one) {
    const reach = one.robot.shapes.map(shape => {
      if (shape.kind === "mesh") {
        const at = unpacked(one.robot.meshes[shape.mesh].corners);
        let far = 0;
        for (let i = 0; i < at.length; i += 3) far = Math.max(far, Math.hypot(at[i], at[i + 1], at[i + 2]));
        return far;
      }
      const [a, b, c] = shape.size;
      return {box: Math.hypot(a, b, c), sphere: a, capsule: a + b, cylinder: Math.hypot(a, b), ellipsoid: Math.max(a, b, c)}[shape.kind] || 0;
    });
    let radius = 0;
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const step = Math.max(1, Math.floor(one.take.moments / 60));
    for (let i = 0; i < one.take.moments; i += step) {
      const seen = one.row(one.path, i, 3);
      seen.forEach((x, k) => { low[k] = Math.min(low[k], x); high[k] = Math.max(high[k], x); });
      one.robot.shapes.forEach((shape, n) => {
        if (shape.body < 0) return;
        radius = Math.max(radius, Math.hypot(...add(one.body(i, shape.body), seen, -1)) + Math.hypot(...shape.position) + reach[n]);
      });
    }
    // What stands still belongs to the picture if it is near.
    const far = one.robot.shapes.map((shape, n) => shape.body < 0 && shape.kind !== "plane"
      ? Math.hypot(...add(shape.position, one.row(one.path, 0, 3), -1)) + reach[n] : 0);
    radius = Math.max(radius, ...far.filter(x => !radius || x < 3 * radius));
    return {radius: radius || 0.1, low, high};
  }

  // The part of the ground on which all of some ways lie: its middle, and half its size, m.
  function around(some) {
    const low = [0, 1, 2].map(k => Math.min(...some.map(one => one.low[k])));
    const high = [0, 1, 2].map(k => Math.max(...some.map(one => one.high[k])));
    return {middle: low.map((x, k) => (x + high[k]) / 2), half: Math.hypot(...low.map((x, k) => high[k] - x)) / 2};
  }

  // A ribbon along points: on the ground where there is one. Returns its corners, and how many belong to the past.
  function ribbon(points, count, normal, wide, height) {
    const out = [], upto = [];
    let before = null, along = null;
    for (let i = 0; i < count; i++) {
      let p = points(i);
      if (height !== null) p = add(p, normal, height - dot(p, normal));
      if (!before || Math.hypot(...add(p, before, -1)) > 0.4 * wide) {
        if (before) along = unit(add(p, before, -1));
        before = p;
        const side = unit(cross(normal, along || [1, 0, 0]));
        if (along || i) for (const s of [-wide / 2, wide / 2]) out.push(...add(p, side, s), ...normal);
      }
      upto.push(out.length / 6);
    }
    return {numbers: new Float32Array(out), upto};
  }

  function start(root) {
    const find = name => root.querySelector(`[data-part="${name}"]`);
    const content = JSON.parse(root.querySelector("script").textContent);
    const canvas = find("canvas"), slider = find("time"), shown = [...root.querySelectorAll("[data-pane]")];
    const [forward, left, up] = content.axes;
    const motions = content.takes.map(take => motion(take, content.robots[take.robot]));
    const extents = motions.map(extent), radius = Math.max(...extents.map(one => one.radius));
    const still = matchMedia("(prefers-reduced-motion: reduce)");
    const state = {t: 0, playing: false, speed: 1, follow: true, trail: true, beside: content.beside,
      chosen: [0, Math.min(1, motions.length - 1)], azimuth: VIEWS.side[0], elevation: VIEWS.side[1], zoom: 1};
    const end = Math.max(...motions.map(one => one.end)), step = Math.min(...motions.map(one => one.take.step_s)) || 0.02;
    const grid = round(0.35 * radius);
    // Of each robot: where its shapes are on their bodies, and which of them move or are planes.
    const figures = content.robots.map(({shapes}) => {
      const order = shapes.map((_, i) => i);
      return {own: shapes.map(shape => vectors.placed(shape.position, shape.turn)), moved: order.filter(i => shapes[i].body >= 0),
        planes: order.filter(i => shapes[i].kind === "plane"), solids: order.filter(i => shapes[i].kind !== "plane")};
    });
    let scene = null, parts = [], grounds = [], trails = [], visible = false, asked = 0, printing = false;

    function build() {
      scene = gaitoptScene(canvas);
      if (!scene) return false;
      parts = content.robots.map(robot => robot.shapes.map(shape => scene.part(gaitoptTriangles(shape, robot.meshes))));
      grounds = content.robots.map(({shapes}, n) => {
        const plane = figures[n].planes.find(i => shapes[i].body < 0);
        return plane === undefined ? null : {point: shapes[plane].position, normal: [...figures[n].own[plane].slice(8, 11)]};
      });
      trails = motions.map((one, n) => {
        const ground = grounds[one.take.robot], lift = 0.004 * radius;
        const normal = ground ? ground.normal : up, height = ground ? dot(ground.point, normal) + lift : null;
        const line = (at, count, wide, above) => {
          const made = ribbon(i => one.row(at, i, 3), count, normal, wide * radius, height === null ? null : height + above * radius);
          return {...made, part: scene.part(made.numbers)};
        };
        return {own: one.marker && line(one.marker, one.take.moments, 0.035, 0),
          measured: one.measured && line(one.measured.at, one.measured.time.length, 0.018, 0.001)};
      });
      trails.ball = scene.part(gaitoptTriangles({kind: "sphere", size: [0.025 * radius]}, []));
      return true;
    }

    // The page may be dark by its own switch: its background says so.
    function look() {
      if (printing) return LOOKS.light;
      for (let element = root; element; element = element.parentElement) {
        const colour = (getComputedStyle(element).backgroundColor.match(/[\d.]+/g) || []).map(Number);
        if (colour.length === 3 || colour[3] > 0.5) return luminance(colour) < 110 ? LOOKS.dark : LOOKS.light;
      }
      return LOOKS.light;
    }

    function drawOne(n, place, style) {
      const one = motions[n], robot = one.robot, ground = grounds[one.take.robot], aspect = place[2] / place[3];
      const {own, moved, planes, solids} = figures[one.take.robot], drawn = parts[one.take.robot];
      const [azimuth, elevation] = [state.azimuth, state.elevation].map(angle => angle * Math.PI / 180);
      const level = add(forward.map(x => x * Math.cos(azimuth)), left, Math.sin(azimuth));
      const back = add(level.map(x => x * Math.cos(elevation)), up, Math.sin(elevation));
      const all = around(state.beside ? state.chosen.map(k => extents[k]) : [extents[n]]);
      const centre = state.follow ? one.followed(state.t) : all.middle;
      const size = 0.66 * radius + (state.follow ? 0 : all.half / Math.max(1, aspect));
      const distance = size / Math.sin(VIEW / 2) / Math.min(1, aspect) / state.zoom;
      const eye = add(centre, back, distance);
      const light = unit(add(add(add(back, up, 1.6), forward, 0.5), left, 0.3));
      scene.pane(place, vectors.seen(eye, centre, up, distance, aspect, VIEW),
        {...style, light, up, centre, reach: 14 * size / state.zoom + 2 * size});
      const bodies = one.placed(state.t), touching = one.touching(state.t);
      const models = robot.shapes.map(({body}, i) => body < 0 ? own[i] : vectors.times(bodies[body], own[i]));
      for (const i of planes) scene.draw(drawn[i], models[i], style.ground, {grid, lit: false});
      if (ground) {
        const lift = 0.002 * radius, shade = [...style.background.map(x => 0.2 * x), style.shadow];
        const down = vectors.flattened(light, ground.point, ground.normal, lift);
        const below = vectors.flattened(ground.normal, ground.point, ground.normal, 1.5 * lift);
        for (const i of moved) scene.draw(drawn[i], models[i], shade, {flatten: down, mark: 1, lit: false});
        for (const i of moved) if (touching(i)) scene.draw(drawn[i], models[i], [...COLOURS.touch.slice(0, 3), 0.8], {flatten: below, mark: 2, lit: false});
      }
      if (state.trail) drawTrails(n);
      const depth = i => dot([models[i][12], models[i][13], models[i][14]], back);
      const clear = i => robot.shapes[i].colour[3] < 1 && !touching(i);
      const seenThrough = solids.filter(clear).sort((a, b) => depth(a) - depth(b));
      for (const i of [...solids.filter(i => !clear(i)), ...seenThrough])
        scene.draw(drawn[i], models[i], touching(i) ? COLOURS.touch : robot.shapes[i].colour);
    }

    function drawTrails(n) {
      const one = motions[n], {own, measured} = trails[n];
      const past = (trail, i, colour) => {
        const upto = trail.upto[i] || 0;
        scene.draw(trail.part, null, [...colour.slice(0, 3), 0.25], {strip: true, lit: false, from: Math.max(0, upto - 2)});
        scene.draw(trail.part, null, colour, {strip: true, lit: false, count: upto});
      };
      const ball = (at, colour) => scene.draw(trails.ball, vectors.placed(at, [1, 0, 0, 0]), colour);
      if (own) { past(own, one.when(state.t)[0], COLOURS.marker); ball(one.marked(state.t), COLOURS.marker); }
      if (measured) {
        const {time, at} = one.measured, i = time.findLastIndex(t => t <= state.t);
        if (i >= 0) { past(measured, i, COLOURS.measured); ball(one.row(at, i, 3), COLOURS.measured); }
      }
    }

    function draw() {
      asked = 0;
      const panes = state.beside ? [0, 1] : [0], wide = canvas.clientWidth, stacked = panes.length > 1 && wide < 560;
      const high = 2 * Math.round(stacked ? 0.62 * wide : Math.min(220, (panes.length === 1 ? 0.29 : 0.18) * wide));
      canvas.style.height = `${high}px`;
      const dots = Math.min(2, devicePixelRatio || 1), [width, height] = [Math.round(wide * dots), Math.round(high * dots)];
      if (canvas.width !== width || canvas.height !== height) { canvas.width = width; canvas.height = height; }
      const style = look();
      panes.forEach(k => {
        const place = panes.length === 1 ? [0, 0, width, height]
          : stacked ? [0, k ? 0 : height - (height >> 1), width, height >> 1] : [k ? width - (width >> 1) : 0, 0, width >> 1, height];
        drawOne(state.chosen[k], place, style);
        const label = shown[k];
        label.style.left = stacked || !k ? "0" : "50%";
        label.style.top = stacked && k ? "50%" : "0";
        label.style.maxWidth = stacked || panes.length === 1 ? "100%" : "50%";
        describe(label, motions[state.chosen[k]]);
      });
      if (shown[1]) shown[1].hidden = !state.beside;
      slider.value = state.t;
      slider.setAttribute("aria-valuetext", `${state.t.toFixed(2)} s`);
      find("clock").textContent = `${state.t.toFixed(2)} s of ${end.toFixed(2)} s`;
    }

    function describe(label, one) {
      const touching = one.touching(state.t), names = one.robot.shapes.filter((shape, i) => touching(i) && shape.body >= 0);
      const from = one.marker && one.row(one.marker, 0, 3), way = from && add(one.marked(state.t), from, -1);
      label.querySelector("[data-part=state]").textContent = way ? `forward ${length(dot(way, forward))}, left ${length(dot(way, left))}` : "";
      const named = names.map(shape => shape.name).filter(Boolean), more = named.length > 4 ? " …" : "";
      label.querySelector("[data-part=touch]").textContent = names.length
        ? `in touch: ${named.slice(0, 4).join(", ") || names.length}${more}` : "nothing in touch";
    }

    const redraw = () => { if (scene && !asked) asked = requestAnimationFrame(draw); };
    let before = null, ticking = 0;
    const go = () => { if (!ticking) ticking = requestAnimationFrame(tick); };  // once a picture, however often it is asked for
    function tick(now) {
      ticking = 0;
      if (!state.playing || !visible || !scene) { before = null; return; }
      if (before !== null) { state.t += state.speed * Math.min(0.1, (now - before) / 1e3); if (state.t > end) state.t = 0; }
      before = now;
      if (asked) cancelAnimationFrame(asked);
      draw();
      go();
    }
    function play(on) {
      if (on === state.playing) return;
      state.playing = on;
      find("play").textContent = on ? "Pause" : "Play";
      if (on) go();
    }
    const seek = t => { state.t = Math.min(end, Math.max(0, t)); redraw(); };
    const by = n => { play(false); seek(step * (Math.round(state.t / step) + n)); };
    const turn = (azimuth, elevation) => { state.azimuth += azimuth; state.elevation = Math.min(89.5, Math.max(-5, state.elevation + elevation)); redraw(); };
    const zoom = factor => { state.zoom = Math.min(12, Math.max(0.15, state.zoom * factor)); redraw(); };
    const press = (name, act) => find(name)?.addEventListener("click", act);

    if (!build()) {
      root.classList.add("flat");
      find("instead").textContent = document.querySelector(".film")
        ? "The film on this page shows it." : "The figure of the way from above shows where it goes.";
      return;
    }
    slider.max = end;
    slider.step = step / 4;
    slider.addEventListener("input", () => { play(false); seek(Number(slider.value)); });
    press("play", () => play(!state.playing));
    press("back", () => by(-1));
    press("on", () => by(1));
    press("near", () => zoom(1.25));
    press("far", () => zoom(0.8));
    for (const button of root.querySelectorAll("[data-speed]")) button.addEventListener("click", () => {
      state.speed = Number(button.dataset.speed);
      for (const other of root.querySelectorAll("[data-speed]")) other.setAttribute("aria-pressed", other === button);
    });
    for (const button of root.querySelectorAll("[data-view]")) button.addEventListener("click", () => {
      [state.azimuth, state.elevation] = VIEWS[button.dataset.view];
      state.zoom = 1;
      redraw();
    });
    for (const name of ["follow", "trail", "beside"]) find(name)?.addEventListener("change", event => { state[name] = event.target.checked; redraw(); });
    shown.forEach((label, k) => label.querySelector("select")?.addEventListener("change", event => { state.chosen[k] = Number(event.target.value); redraw(); }));

    const fingers = new Map();
    canvas.addEventListener("pointerdown", event => { fingers.set(event.pointerId, [event.clientX, event.clientY]); canvas.setPointerCapture(event.pointerId); });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, event => fingers.delete(event.pointerId));
    canvas.addEventListener("pointermove", event => {
      const from = fingers.get(event.pointerId);
      if (!from) return;
      const to = [event.clientX, event.clientY], other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
      if (other) zoom(Math.hypot(to[0] - other[0], to[1] - other[1]) / (Math.hypot(from[0] - other[0], from[1] - other[1]) || 1));
      turn(-0.4 * (to[0] - from[0]) / fingers.size, 0.4 * (to[1] - from[1]) / fingers.size);
      fingers.set(event.pointerId, to);
    });
    canvas.addEventListener("wheel", event => {
      if (!event.ctrlKey && document.activeElement !== canvas) return;  // otherwise the page scrolls
      event.preventDefault();
      zoom(Math.exp(-0.0015 * event.deltaY));
    }, {passive: false});
    const keys = {ArrowLeft: () => turn(-5, 0), ArrowRight: () => turn(5, 0), ArrowUp: () => turn(0, 5), ArrowDown: () => turn(0, -5),
      "+": () => zoom(1.25), "=": () => zoom(1.25), "-": () => zoom(0.8), " ": () => play(!state.playing), ",": () => by(-1), ".": () => by(1), Home: () => seek(0), End: () => seek(end)};
    canvas.addEventListener("keydown", event => { if (keys[event.key] && !event.altKey && !event.ctrlKey && !event.metaKey) { event.preventDefault(); keys[event.key](); } });
    canvas.addEventListener("webglcontextlost", event => { event.preventDefault(); scene = null; });
    canvas.addEventListener("webglcontextrestored", () => { build(); redraw(); go(); });
    addEventListener("beforeprint", () => { printing = true; if (scene) draw(); });
    addEventListener("afterprint", () => { printing = false; redraw(); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
    new MutationObserver(redraw).observe(document.documentElement, {attributes: true});
    new ResizeObserver(redraw).observe(canvas);
    still.addEventListener("change", () => { if (still.matches) play(false); });
    let first = true;
    new IntersectionObserver(([entry]) => {
      visible = entry.isIntersecting;
      if (visible && first) { first = false; play(!still.matches); }
      else if (visible) go();
    }, {threshold: 0.3}).observe(canvas);
    find("grid").textContent = grounds.some(Boolean) ? `squares on the ground: ${length(grid)}` : "";
    draw();
  }

  for (const root of document.querySelectorAll(".player")) start(root);
})();
