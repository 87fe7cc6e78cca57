// Draws robots with WebGL 2: `gaitoptScene(canvas)` returns a scene, or null where there is no WebGL.
// World coordinates are those of the simulation, in m.
const gaitoptNumbers = (() => {
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const unpacked = ({low, step, data}) => {
    const columns = low.length;
    return Float32Array.from(new Uint16Array(bytes(data).buffer),
      (value, i) => low[i % columns] + step[i % columns] * value);
  };
  const turns = text => Float32Array.from(new Int16Array(bytes(text).buffer), value => value / 32767);
  return {bytes, unpacked, turns};
})();

const gaitoptVectors = {
  add: (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit: a => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; },
  // Matrices are in columns, as WebGL takes them.
  times: (a, b) => {
    const c = new Float32Array(16);
    for (let i = 0; i < 4; i++) for (let j = 0; j < 4; j++)
      for (let k = 0; k < 4; k++) c[4 * i + j] += a[4 * k + j] * b[4 * i + k];
    return c;
  },
  placed: (p, q) => {
    const l = Math.hypot(...q) || 1, [w, x, y, z] = q.map(part => part / l);
    return new Float32Array([
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0, ...p, 1]);
  },
  // The projection along a direction onto the plane through a point; a little above the plane.
  flattened: (along, point, normal, lift) => {
    const v = gaitoptVectors, m = new Float32Array(16), down = v.dot(along, normal);
    const height = v.dot(point, normal) + lift;
    for (let i = 0; i < 3; i++) for (let j = 0; j < 3; j++)
      m[4 * i + j] = (i === j ? 1 : 0) - along[j] * normal[i] / down;
    for (let j = 0; j < 3; j++) m[12 + j] = along[j] * height / down;
    m[15] = 1;
    return m;
  },
  seen: (eye, centre, up, distance, aspect, view) => {
    const v = gaitoptVectors, back = v.unit(v.add(eye, centre, -1));
    const right = v.unit(v.cross(up, back)), top = v.cross(back, right);
    const near = 0.02 * distance, far = 60 * distance, f = 1 / Math.tan(view / 2);
    const look = new Float32Array([right[0], top[0], back[0], 0, right[1], top[1], back[1], 0,
      right[2], top[2], back[2], 0, -v.dot(right, eye), -v.dot(top, eye), -v.dot(back, eye), 1]);
    const lens = new Float32Array([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (near + far) / (near - far), -1,
      0, 0, 2 * near * far / (near - far), 0]);
    return v.times(lens, look);
  },
};

// Triangles of a shape, each corner with its normal: six numbers a corner, in the shape's frame.
const gaitoptTriangles = (() => {
  const {add, cross, unit, dot} = gaitoptVectors;

  function box([a, b, c]) {
    const out = [];
    for (let axis = 0; axis < 3; axis++) for (const side of [-1, 1]) {
      const normal = [0, 0, 0], half = [a, b, c], [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
      normal[axis] = side;
      const corner = (i, j) => {
        const p = [0, 0, 0];
        p[axis] = side * half[axis]; p[u] = i * half[u]; p[v] = j * half[v];
        return [...p, ...normal];
      };
      const around = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => corner(i, j * side));
      for (const k of [0, 1, 2, 0, 2, 3]) out.push(...around[k]);
    }
    return out;
  }

  // A surface of revolution about z, from rows [radius, height, normal outward, normal upward].
  function turned(rows, scale = [1, 1, 1]) {
    const out = [], parts = 28;
    const corner = (row, k) => {
      const angle = 2 * Math.PI * k / parts, [r, h, n, m] = rows[row];
      const p = [r * Math.cos(angle), r * Math.sin(angle), h].map((x, i) => x * scale[i]);
      return [...p, ...unit([n * Math.cos(angle), n * Math.sin(angle), m].map((x, i) => x / scale[i]))];
    };
    for (let row = 0; row + 1 < rows.length; row++) for (let k = 0; k < parts; k++) {
      const [a, b, c, d] = [corner(row, k), corner(row, k + 1), corner(row + 1, k + 1), corner(row + 1, k)];
      out.push(...a, ...b, ...c, ...a, ...c, ...d);
    }
    return out;
  }

  const arc = (radius, from, to, height) => Array.from({length: 9}, (_, i) => {
    const angle = from + (to - from) * i / 8, [n, m] = [Math.cos(angle), Math.sin(angle)];
    return [radius * n, height + radius * m, n, m];
  });
  const quarter = Math.PI / 2;
  const ball = arc(1, -quarter, 0, 0).concat(arc(1, 0, quarter, 0).slice(1));
  const capsule = ([r, h]) => turned(arc(r, -quarter, 0, -h).concat(arc(r, 0, quarter, h)));
  const cylinder = ([r, h]) => turned([[0, -h, 0, -1], [r, -h, 0, -1], [r, -h, 1, 0], [r, h, 1, 0],
    [r, h, 0, 1], [0, h, 0, 1]]);

  // Normals are smooth but at sharp edges.
  function mesh({corners, faces}) {
    const {unpacked, bytes} = gaitoptNumbers, at = unpacked(corners);
    const of = new Uint16Array(bytes(faces).buffer), normals = new Float32Array(at.length), out = [];
    const point = i => [at[3 * i], at[3 * i + 1], at[3 * i + 2]];
    const flat = [];
    for (let f = 0; f < of.length; f += 3) {
      const [a, b, c] = [of[f], of[f + 1], of[f + 2]].map(point);
      const normal = cross(add(b, a, -1), add(c, a, -1));
      flat.push(normal);
      for (let k = 0; k < 3; k++) for (let i = 0; i < 3; i++) normals[3 * of[f + k] + i] += normal[i];
    }
    for (let f = 0; f < of.length; f += 3) for (let k = 0; k < 3; k++) {
      const own = unit(flat[f / 3]), i = of[f + k];
      const mean = unit([normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]]);
      out.push(...point(i), ...(dot(own, mean) > 0.75 ? mean : own));
    }
    return out;
  }

  return (shape, meshes) => new Float32Array({
    box: () => box(shape.size),
    sphere: () => turned(ball, [shape.size[0], shape.size[0], shape.size[0]]),
    ellipsoid: () => turned(ball, shape.size),
    capsule: () => capsule(shape.size),
    cylinder: () => cylinder(shape.size),
    mesh: () => mesh(meshes[shape.mesh]),
    plane: () => [[-1, -1], [1, -1], [1, 1], [-1, -1], [1, 1], [-1, 1]]
      .flatMap(([x, y]) => [x * (shape.size[0] || 1e3), y * (shape.size[1] || 1e3), 0, 0, 0, 1]),
  }[shape.kind]());
})();

const gaitoptScene = (() => {
  const vertex = `#version 300 es
    in vec3 place; in vec3 normal; uniform mat4 model; uniform mat4 view; uniform mat4 flatten;
    out vec3 facing; out vec3 world; out vec2 local;
    void main() {
      vec4 at = flatten * (model * vec4(place, 1.0));
      world = at.xyz; facing = mat3(model) * normal; local = place.xy; gl_Position = view * at;
    }`;
  const fragment = `#version 300 es
    precision highp float;
    in vec3 facing; in vec3 world; in vec2 local; out vec4 result;
    uniform vec4 colour; uniform vec3 light; uniform vec3 up; uniform float lit; uniform float grid;
    uniform vec4 lines; uniform vec3 background; uniform vec3 centre; uniform float reach;
    void main() {
      vec3 shade = colour.rgb;
      if (lit > 0.5) {
        vec3 n = normalize(gl_FrontFacing ? facing : -facing);
        shade *= 0.55 + 0.38 * max(dot(n, light), 0.0) + 0.14 * dot(n, up);
      }
      if (grid > 0.0) {
        vec2 cell = local / grid, wide = max(fwidth(cell), vec2(1e-6));
        vec2 off = abs(fract(cell - 0.5) - 0.5) / wide;
        float line = clamp(1.2 - min(off.x, off.y), 0.0, 1.0) * clamp(0.5 / max(wide.x, wide.y) - 0.6, 0.0, 1.0);
        shade = mix(shade, lines.rgb, line * lines.a);
        shade = mix(shade, background, smoothstep(0.35, 1.0, distance(world, centre) / reach));
      }
      result = vec4(shade, colour.a);
    }`;
  const same = new Float32Array([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);

  return canvas => {
    const gl = canvas.getContext("webgl2", {stencil: true, alpha: false, preserveDrawingBuffer: true});
    if (!gl) return null;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.bindAttribLocation(program, 0, "place");
    gl.bindAttribLocation(program, 1, "normal");
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) return null;
    gl.useProgram(program);
    const at = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const {name} = gl.getActiveUniform(program, i);
      at[name] = gl.getUniformLocation(program, name);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);

    const part = numbers => {
      const array = gl.createVertexArray();
      gl.bindVertexArray(array);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(0);
      gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 24, 0);
      gl.enableVertexAttribArray(1);
      gl.vertexAttribPointer(1, 3, gl.FLOAT, false, 24, 12);
      return {array, count: numbers.length / 6};
    };

    // Begins one pane: its place on the canvas, pixels from the lower left, and what it looks like.
    const pane = ([x, y, width, height], view, look) => {
      gl.viewport(x, y, width, height);
      gl.scissor(x, y, width, height);
      gl.enable(gl.SCISSOR_TEST);
      gl.clearColor(...look.background, 1);
      gl.stencilMask(255);
      gl.depthMask(true);
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
      gl.uniformMatrix4fv(at.view, false, view);
      gl.uniform3fv(at.light, look.light);
      gl.uniform3fv(at.up, look.up);
      gl.uniform4fv(at.lines, look.lines);
      gl.uniform3fv(at.background, look.background);
      gl.uniform3fv(at.centre, look.centre);
      gl.uniform1f(at.reach, look.reach);
    };

    // Draws a part. How: flatten (a projection), mark (1 for each place once), grid (m), lit, from, count, strip.
    const draw = (one, model, colour, how = {}) => {
      gl.bindVertexArray(one.array);
      gl.uniformMatrix4fv(at.model, false, model || same);
      gl.uniformMatrix4fv(at.flatten, false, how.flatten || same);
      gl.uniform4fv(at.colour, colour);
      gl.uniform1f(at.lit, how.lit === false ? 0 : 1);
      gl.uniform1f(at.grid, how.grid || 0);
      (colour[3] < 1 ? gl.enable : gl.disable).call(gl, gl.BLEND);
      (how.mark ? gl.enable : gl.disable).call(gl, gl.STENCIL_TEST);
      if (how.mark) {
        gl.stencilFunc(gl.NOTEQUAL, how.mark, how.mark);
        gl.stencilOp(gl.KEEP, gl.KEEP, gl.REPLACE);
        gl.stencilMask(how.mark);
      }
      gl.depthMask(!how.flatten && !how.strip);
      const mode = how.strip ? gl.TRIANGLE_STRIP : gl.TRIANGLES;
      const from = how.from || 0, count = how.count ?? one.count - from;
      if (colour[3] < 1 && !how.flatten && !how.strip) {
        gl.enable(gl.CULL_FACE);
        for (const side of [gl.FRONT, gl.BACK]) { gl.cullFace(side); gl.drawArrays(mode, from, count); }
        gl.disable(gl.CULL_FACE);
      } else if (count > 0) gl.drawArrays(mode, from, count);
    };

    return {part, pane, draw};
  };
})();
