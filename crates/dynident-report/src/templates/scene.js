"use strict";
// Robots in three dimensions. Each scene replaces its still picture once the browser can draw it.
(() => {
  const element = (name, properties, ...children) => {
    const made = Object.assign(document.createElement(name), properties);
    made.append(...children);
    return made;
  };
  const still = matchMedia("(prefers-reduced-motion: reduce)");

  // Poses are [rotation (rows), origin]; `parent_from_body` of the body at position `q` of its joints.
  const times = (a, b) => a.map((row) => [0, 1, 2].map((k) => row[0] * b[0][k] + row[1] * b[1][k] + row[2] * b[2][k]));
  const point = (a, p) => a.map((row) => row[0] * p[0] + row[1] * p[1] + row[2] * p[2]);
  const turn = ([x, y, z], angle) => {
    const [s, c] = [Math.sin(angle), Math.cos(angle)];
    const v = 1 - c;
    return [[c + x * x * v, x * y * v - z * s, x * z * v + y * s], [y * x * v + z * s, c + y * y * v, y * z * v - x * s], [z * x * v - y * s, z * y * v + x * s, c + z * z * v]];
  };
  const poses = (data, q) => {
    const found = [];
    for (const body of data.bodies) {
      const at = body.drivers.reduce((sum, [joint, factor]) => sum + factor * q[joint], body.offset);
      let [rotation, origin] = [body.rotation, body.translation];
      if (body.motion === "turns") rotation = times(rotation, turn(body.axis, at));
      if (body.motion === "slides") origin = point(rotation, body.axis.map((x) => x * at)).map((x, k) => x + origin[k]);
      if (body.parent != null) {
        const [outer, start] = found[body.parent];
        [rotation, origin] = [times(outer, rotation), point(outer, origin).map((x, k) => x + start[k])];
      }
      found.push([rotation, origin]);
    }
    return found;
  };

  // Corners of all triangles with normals: smooth across edges below 35°, sharp otherwise.
  const corners = (body) => {
    const place = (k) => [0, 1, 2].map((a) => body.low[a] + body.step * body.vertices[3 * k + a]);
    const minus = (a, b) => a.map((x, k) => x - b[k]);
    const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    const count = body.triangles.length / 3;
    const at = Array.from({ length: body.vertices.length / 3 }, (_, k) => place(k));
    const faces = Array.from({ length: count }, (_, t) => {
      const [a, b, c] = [0, 1, 2].map((k) => at[body.triangles[3 * t + k]]);
      const area = cross(minus(b, a), minus(c, a));
      const size = Math.hypot(...area) || 1;
      return { area, normal: area.map((x) => x / size) };
    });
    const around = at.map(() => []);
    body.triangles.forEach((vertex, k) => around[vertex].push(Math.floor(k / 3)));
    const position = new Float32Array(9 * count);
    const normal = new Float32Array(9 * count);
    body.triangles.forEach((vertex, k) => {
      const own = faces[Math.floor(k / 3)].normal;
      const sum = [0, 0, 0];
      for (const face of around[vertex]) if (dot(faces[face].normal, own) > 0.82) faces[face].area.forEach((x, a) => { sum[a] += x; });
      position.set(at[vertex], 3 * k);
      normal.set(sum, 3 * k);
    });
    return { position: { size: 3, data: position }, normal: { size: 3, data: normal } };
  };

  const vertex = `#version 300 es
    in vec3 position; in vec3 normal; uniform mat4 modelViewMatrix; uniform mat4 projectionMatrix; out vec3 n;
    void main() { n = mat3(modelViewMatrix) * normal; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`;
  const fragment = `#version 300 es
    precision highp float; in vec3 n; uniform vec3 colour; uniform float opacity; uniform float lit; out vec4 result;
    void main() {
      float side = dot(normalize(n), normalize(vec3(-0.35, 0.7, 0.6)));
      result = vec4(colour * mix(1.0, 0.55 + 0.45 * max(side, 0.0) + 0.1 * min(side, 0.0), lit), opacity);
    }`;

  const sphere = () => {
    const [position, index, rings, sides] = [[], [], 12, 20];
    for (let i = 0; i <= rings; i++) for (let j = 0; j <= sides; j++) {
      const [a, b] = [(Math.PI * i) / rings, (2 * Math.PI * j) / sides];
      position.push(Math.sin(a) * Math.cos(b), Math.sin(a) * Math.sin(b), Math.cos(a));
    }
    for (let i = 0; i < rings; i++) for (let j = 0; j < sides; j++) {
      const k = i * (sides + 1) + j;
      index.push(k, k + sides + 1, k + 1, k + 1, k + sides + 1, k + sides + 2);
    }
    const data = new Float32Array(position);
    return { position: { size: 3, data }, normal: { size: 3, data }, index: { data: new Uint16Array(index) } };
  };

  // Lines of the floor, the column and the boxes.
  const lines = (data, reach) => {
    const list = [];
    const line = (a, b) => list.push(...a, ...b);
    const height = data.floor ?? 0;
    const step = reach > 2 ? 0.5 : reach > 0.6 ? 0.2 : 0.05;
    const cells = Math.ceil(reach / step);
    for (let k = -cells; k <= cells; k++) {
      line([k * step, -cells * step, height], [k * step, cells * step, height]);
      line([-cells * step, k * step, height], [cells * step, k * step, height]);
    }
    if (data.column) {
      const [x, y, radius] = data.column;
      for (let k = 0; k < 32; k++) {
        const [a, b] = [k, k + 1].map((side) => (2 * Math.PI * side) / 32).map((angle) => [x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
        for (const z of [height, height + reach]) line([...a, z], [...b, z]);
        if (k % 4 === 0) line([...a, height], [...a, height + reach]);
      }
    }
    for (const box of data.boxes) {
      const side = (axis, end) => box[axis][end] ?? (end ? reach : -reach);
      for (const [a, b, c] of [[0, 1, 2], [1, 2, 0], [2, 0, 1]]) for (const m of [0, 1]) for (const n of [0, 1]) {
        const ends = [0, 1].map((end) => { const p = [0, 0, 0]; p[a] = side(a, end); p[b] = side(b, m); p[c] = side(c, n); return p; });
        line(...ends);
      }
    }
    return { position: { size: 3, data: new Float32Array(list) }, normal: { size: 3, data: new Float32Array(list.length) } };
  };

  const short = (value) => (value == null ? "–" : String(+value.toPrecision(3)));

  const show = (holder, data) => {
    const canvas = element("canvas", { ariaHidden: "true" });
    let renderer;
    try {
      renderer = new OGL.Renderer({ canvas, antialias: true, alpha: false, preserveDrawingBuffer: true, dpr: Math.min(devicePixelRatio, 2), powerPreference: "low-power" });
    } catch { return; }
    const gl = renderer.gl;
    if (!gl || !renderer.isWebgl2) return;
    const uniforms = () => ({ colour: { value: [1, 1, 1] }, opacity: { value: 1 }, lit: { value: 1 } });
    const solid = new OGL.Program(gl, { vertex, fragment, uniforms: uniforms(), cullFace: false });
    const clear = new OGL.Program(gl, { vertex, fragment, uniforms: uniforms(), cullFace: false, transparent: true, depthWrite: false });
    const world = new OGL.Transform();
    const add = (geometry, program, style) => {
      const mesh = new OGL.Mesh(gl, { geometry, program, mode: style.lines ? gl.LINES : gl.TRIANGLES, frustumCulled: false });
      mesh.matrixAutoUpdate = false;
      mesh.onBeforeRender(() => {
        const values = mesh.program.uniforms;
        values.colour.value = style.colour;
        values.opacity.value = style.opacity ?? 1;
        values.lit.value = style.lines ? 0 : 1;
      });
      mesh.look = style;
      mesh.setParent(world);
      return mesh;
    };
    const palette = data.palette.map((colour) => colour.map((part) => part / 255));
    const grey = palette[7];
    const unit = new OGL.Geometry(gl, sphere());
    const ghosts = data.motions.some((motion) => motion.ghost.length);
    const parts = data.bodies.map((body) => {
      const part = { body, ellipsoids: [], ghost: null, mesh: null };
      if (body.triangles.length) {
        const geometry = new OGL.Geometry(gl, corners(body));
        part.mesh = add(geometry, solid, { colour: grey });
        if (ghosts) part.ghost = add(geometry, clear, { colour: palette[1], opacity: 0.3 });
      }
      part.ellipsoids = body.ellipsoids.map((own) => add(unit, clear, { colour: palette[own.earlier ? 1 : 0], opacity: 0.45 }));
      return part;
    });

    // Marks of the nearest points of two bodies and of the line between them, which other bodies do not hide.
    const above = new OGL.Program(gl, { vertex, fragment, uniforms: uniforms(), cullFace: false, transparent: true, depthTest: false, depthWrite: false });
    const marks = Array.from({ length: Math.max(0, ...data.motions.map((motion) => motion.pairs.length)) }, () => [0, 1, 2].map(() => add(unit, above, { colour: palette[1] })));

    const pose = (mesh, [rotation, origin]) => {
      const [a, b, c] = rotation;
      mesh.matrix.set(a[0], b[0], c[0], 0, a[1], b[1], c[1], 0, a[2], b[2], c[2], 0, origin[0], origin[1], origin[2], 1);
      mesh.worldMatrixNeedsUpdate = true;
    };
    // The view contains the robot along its motions: the boxes around its bodies at some instants.
    let [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    const extents = data.bodies.map((body) => {
      const ends = [0, 0, 0];
      body.vertices.forEach((steps, i) => { ends[i % 3] = Math.max(ends[i % 3], steps); });
      return ends;
    });
    const instants = data.motions.flatMap(({ q, t }) => Array.from({ length: 16 }, (_, i) => q.map((row) => row[Math.floor((i * (t.length - 1)) / 15)])));
    for (const q of instants.length ? instants.filter((own) => own.every((value) => value != null)) : [data.posture]) {
      poses(data, q).forEach(([rotation, origin], k) => {
        const body = data.bodies[k];
        if (!body.triangles.length) return;
        for (let corner = 0; corner < 8; corner++) {
          const p = point(rotation, [0, 1, 2].map((a) => body.low[a] + (corner >> a & 1) * body.step * extents[k][a])).map((x, a) => x + origin[a]);
          low = low.map((x, a) => Math.min(x, p[a]));
          high = high.map((x, a) => Math.max(x, p[a]));
        }
      });
    }
    if (!(high[0] >= low[0])) return;
    const reach = Math.max(...high.map((x, a) => Math.max(Math.abs(x), Math.abs(low[a]))), 0.05);
    const size = Math.hypot(...high.map((x, a) => x - low[a]));
    const ground = add(new OGL.Geometry(gl, lines(data, reach * 1.1)), clear, { colour: grey, opacity: 0.45, lines: true });
    pose(ground, [[[1, 0, 0], [0, 1, 0], [0, 0, 1]], [0, 0, 0]]);

    const camera = new OGL.Camera(gl, { fov: 30, near: size / 100, far: size * 40 });
    camera.up.set(0, 0, 1);
    // Half of the height and of the width fit into the angle of view, 15° to each side.
    const round = Math.hypot(high[0] - low[0], high[1] - low[1]) / 2;
    const wide = holder.clientWidth > 600 ? 1.7 : 1;
    const far = (1.15 * Math.max((high[2] - low[2]) / 2, round / wide)) / Math.tan(Math.PI / 12) + 0.6 * round;
    const home = { turn: 0.7, tilt: 0.35, far, at: low.map((x, a) => (x + high[a]) / 2) };
    const eye = { ...home, at: [...home.at] };
    const state = { motion: 0, time: 0, playing: false, rate: 1, ghost: false, ellipsoids: false, colouring: 0, body: null, q: data.posture };

    let waiting = false;
    const isLow = Boolean(holder.closest(".low"));
    const [lowest, highest] = isLow ? [220, 300] : [280, 460];
    const render = () => {
      waiting = false;
      const [width, height] = [holder.clientWidth, Math.round(Math.min(highest, Math.max(lowest, holder.clientWidth * 0.55)))];
      if (renderer.width !== width || renderer.height !== height) {
        renderer.setSize(width, height);
        camera.perspective({ aspect: width / height });
      }
      const flat = Math.cos(eye.tilt) * eye.far;
      camera.position.set(eye.at[0] + flat * Math.cos(eye.turn), eye.at[1] + flat * Math.sin(eye.turn), eye.at[2] + Math.sin(eye.tilt) * eye.far);
      camera.lookAt(eye.at);
      const ground = getComputedStyle(stage).backgroundColor.match(/[\d.]+/g).map(Number);
      gl.clearColor(ground[0] / 255, ground[1] / 255, ground[2] / 255, 1);
      renderer.render({ scene: world, camera });
    };
    const draw = () => {
      if (waiting) return;
      waiting = true;
      requestAnimationFrame(render);
    };

    const sample = (rows, motion, time) => {
      const t = motion.t;
      let [a, b] = [0, t.length - 1];
      while (b - a > 1) { const middle = (a + b) >> 1; if (t[middle] <= time) a = middle; else b = middle; }
      const share = b > a ? Math.min(1, Math.max(0, (time - t[a]) / (t[b] - t[a]))) : 0;
      return rows.map((row) => (row.length ? (row[a] == null || row[b] == null ? row[a] ?? row[b] : row[a] + share * (row[b] - row[a])) : null));
    };
    const place = (q) => {
      state.q = q;
      poses(data, q).forEach((found, k) => {
        const { mesh, ellipsoids, body } = parts[k];
        if (mesh) pose(mesh, found);
        ellipsoids.forEach((own, i) => {
          const { shape, centre } = body.ellipsoids[i];
          own.visible = state.ellipsoids;
          pose(own, [times(found[0], shape), point(found[0], centre).map((x, a) => x + found[1][a])]);
        });
      });
    };

    // Along the line a rod (an ellipsoid of the length), at its ends balls.
    const mark = (meshes, ends, colour) => {
      meshes.forEach((mesh) => { mesh.visible = ends != null; mesh.look.colour = colour; });
      if (!ends) return;
      const along = ends[1].map((x, a) => (x - ends[0][a]) / 2);
      const [thin, length] = [0.003 * size, Math.hypot(...along)];
      const unit = along.map((x) => x / (length || 1));
      // A ball of the thickness, stretched along the line.
      const stretched = [0, 1, 2].map((row) => [0, 1, 2].map((column) => (row === column ? thin : 0) + (Math.max(length, thin) - thin) * unit[row] * unit[column]));
      pose(meshes[0], [stretched, ends[0].map((x, a) => x + along[a])]);
      ends.forEach((end, k) => pose(meshes[k + 1], [[[2.2 * thin, 0, 0], [0, 2.2 * thin, 0], [0, 0, 2.2 * thin]], end]));
    };
    const markPairs = (motion, time) => marks.forEach((meshes, k) => {
      const pair = motion.pairs[k];
      const places = pair ? sample(pair.points, motion, time) : [null];
      const ends = places.includes(null) ? null : [places.slice(0, 3), places.slice(3)];
      mark(meshes, ends, ends && sample([pair.distance], motion, time)[0] < pair.clearance ? [0.85, 0.1, 0.1] : palette[1]);
    });

    // Colours.
    const list = element("ul", { className: "bodies" });
    const buttons = data.bodies.map((body, k) => {
      const swatch = element("span", { className: "swatch" });
      const words = element("span", { className: "note" });
      const button = element("button", { type: "button" }, swatch, element("b", {}, body.name), " ", words);
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => choose(state.body === k ? null : k));
      if (body.triangles.length || body.drivers.length) list.append(element("li", {}, button));
      return { button, swatch, words };
    });
    const legend = element("p", { className: "legend note" });
    const css = (colour) => `rgb(${colour.map((part) => Math.round(255 * part)).join(" ")})`;
    const paint = () => {
      const colouring = data.colourings[state.colouring];
      const motion = data.motions[state.motion];
      const gauge = motion?.gauges[colouring?.gauge];
      const now = gauge ? sample(gauge.values, motion, state.time) : [];
      const mixed = (k) => {
        const joint = data.bodies[k].drivers[0]?.[0];
        const limits = gauge.limits[joint];
        if (joint == null || !limits || now[joint] == null) return grey;
        const share = Math.min(1, Math.abs(now[joint]) / Math.max(Math.abs(limits[0]), Math.abs(limits[1])));
        const [from, to] = [0, 1].map((end) => palette[colouring.classes[end][1] % 8]);
        return from.map((part, a) => part + share * (to[a] - part));
      };
      data.bodies.forEach((_, k) => {
        const own = colouring?.of[k];
        const colour = gauge ? mixed(k) : own == null ? grey : palette[colouring.classes[own][1] % 8];
        const chosen = state.body === k;
        if (parts[k].mesh) parts[k].mesh.look.colour = chosen ? colour.map((part) => part * 0.45 + 0.55) : colour;
        buttons[k].swatch.style.background = css(colour);
        buttons[k].words.textContent = colouring?.words[k] ?? "";
        buttons[k].button.setAttribute("aria-pressed", String(chosen));
      });
      legend.replaceChildren(...(colouring?.classes ?? []).flatMap(([text, number]) => {
        const swatch = element("span", { className: "swatch" });
        swatch.style.background = css(palette[number % 8]);
        return [swatch, `${text}\u2003`];
      }));
      if (state.ellipsoids) legend.append("ellipsoids: solids of uniform density with the mass distribution of each body, identified (blue) and described (orange)\u2003");
      if (state.ghost) legend.append("pale arm: desired motion\u2003");
      if (motion?.pairs.length) legend.append(`rods: nearest points of links within ${short(Math.max(...motion.pairs.map((pair) => pair.near)))} m (red: below the minimum distance)`);
      draw();
    };
    let choosing = false;
    const choose = (k) => {
      state.body = k;
      const joint = k == null ? null : data.bodies[k].drivers[0]?.[0];
      choosing = true;
      document.dispatchEvent(new CustomEvent("joint", { detail: joint == null ? null : data.joints[joint] }));
      choosing = false;
      paint();
    };
    document.addEventListener("joint", () => {
      if (choosing) return;
      state.body = null;
      paint();
    });

    // Playback.
    const gauges = element("div", { className: "gauges", tabIndex: 0, role: "region", ariaLabel: "joints along the motion" });
    let meters = [];
    const clock = element("output", { className: "note" });
    const slider = element("input", { type: "range", min: 0, step: "any", ariaLabel: "time of the motion" });
    const play = element("button", { type: "button", className: "play" });
    const move = (time) => {
      const motion = data.motions[state.motion];
      const end = motion.t[motion.t.length - 1];
      state.time = Math.min(Math.max(time, motion.t[0]), end);
      slider.value = state.time;
      clock.textContent = `${state.time.toFixed(2)} of ${(+end).toFixed(2)} s`;
      place(sample(motion.q, motion, state.time));
      state.ghost = motion.ghost.length > 0;
      if (ghosts) {
        const found = state.ghost ? poses(data, sample(motion.ghost, motion, state.time)) : null;
        parts.forEach(({ ghost }, k) => { if (ghost) { ghost.visible = !!found; if (found) pose(ghost, found[k]); } });
      }
      markPairs(motion, state.time);
      meters.forEach(({ meter, row, limits, near, text }) => {
        const [value] = sample([row], motion, state.time);
        meter.value = value ?? 0;
        text.textContent = short(value);
        if (near != null) meter.classList.toggle("near", value < near);
        if (limits) meter.classList.toggle("near", value != null && Math.max((value - limits[1]) / (limits[1] - limits[0]), (limits[0] - value) / (limits[1] - limits[0])) > -0.025);
      });
      if (data.colourings[state.colouring]?.gauge != null) paint();
      draw();
    };
    const gauge = () => {
      const motion = data.motions[state.motion];
      meters = [];
      if (!motion.gauges.length) return gauges.replaceChildren();
      const head = element("tr", {}, element("th", {}, "joint"), ...motion.gauges.map((own) => element("th", {}, own.name)));
      const rows = data.joints.map((name, joint) => {
        const row = element("tr", {}, element("td", {}, name));
        for (const own of motion.gauges) {
          const cell = element("td", { className: "number" });
          row.append(cell);
          const values = own.values[joint];
          if (!values.length) continue;
          const limits = own.limits[joint];
          const most = Math.max(...values.map((value) => Math.abs(value ?? 0))) || 1;
          const [from, to] = limits ?? [-most, most];
          const meter = element("meter", { min: from, max: to, ariaLabel: `${own.name} of ${name}` });
          const text = element("span", {});
          meter.title = limits ? `limits ${short(from)} to ${short(to)}` : `largest value ${short(most)}`;
          cell.append(meter, " ", text);
          meters.push({ meter, row: values, limits, text });
        }
        return row;
      });
      const table = (top, body) => element("table", {}, element("thead", {}, top), element("tbody", {}, ...body));
      gauges.replaceChildren(table(head, rows));
      if (!motion.pairs.length) return;
      const pairs = motion.pairs.map((pair) => {
        const meter = element("meter", { min: 0, max: Math.max(...pair.distance, pair.near), ariaLabel: `distance of ${pair.name}` });
        const text = element("span", {});
        meters.push({ meter, row: pair.distance, near: pair.near, text });
        return element("tr", {}, element("td", {}, pair.name), element("td", { className: "number" }, meter, " ", text), element("td", { className: "number" }, short(pair.clearance)));
      });
      gauges.append(table(element("tr", {}, ...["links", "distance, m", "at least, m"].map((text) => element("th", {}, text))), pairs));
    };
    let last;
    const step = (now) => {
      if (!state.playing) return;
      const motion = data.motions[state.motion];
      const end = motion.t[motion.t.length - 1];
      const next = state.time + (state.rate * (now - (last ?? now))) / 1000;
      last = now;
      move(next >= end ? motion.t[0] : next);
      requestAnimationFrame(step);
    };
    const run = (playing) => {
      state.playing = playing;
      last = undefined;
      play.textContent = playing ? "❚❚ Pause" : "▶ Play";
      if (playing) requestAnimationFrame(step);
    };

    // Controls.
    const select = (label, options, chosen) => {
      const box = element("select", {}, ...options.map((text, value) => element("option", { value }, text)));
      box.addEventListener("change", () => chosen(Number(box.value)));
      return element("label", {}, `${label} `, box);
    };
    const bar = element("div", { className: "bar" });
    if (data.colourings.length > 1) bar.append(select("Colours", data.colourings.map((own) => own.name), (k) => { state.colouring = k; paint(); }));
    if (data.bodies.some((body) => body.ellipsoids.length)) {
      const box = element("input", { type: "checkbox" });
      box.addEventListener("change", () => {
        state.ellipsoids = box.checked;
        parts.forEach(({ mesh }) => { if (mesh) { mesh.program = box.checked ? clear : solid; mesh.look.opacity = box.checked ? 0.35 : 1; } });
        place(state.q);
        paint();
      });
      bar.append(element("label", {}, box, " mass distribution"));
    }
    const back = element("button", { type: "button" }, "Reset view");
    back.addEventListener("click", () => { Object.assign(eye, home, { at: [...home.at] }); draw(); });
    bar.append(back);
    const stage = element("div", { className: "stage", tabIndex: 0 }, canvas);
    stage.setAttribute("role", "group");
    stage.setAttribute("aria-label", `${holder.dataset.words}. Keys: arrows turn, + and - zoom, 0 resets${data.motions.length ? ", space plays" : ""}.`);
    const film = element("div", { className: "bar" });
    if (data.motions.length) {
      const begin = (k) => {
        state.motion = k;
        const { t } = data.motions[k];
        [slider.min, slider.max] = [t[0], t[t.length - 1]];
        gauge();
        move(t[0]);
        paint();
      };
      if (data.motions.length > 1) film.append(select("Motion", data.motions.map((own) => own.name), begin));
      film.append(play, slider, clock, select("Speed", ["1", "0.5", "0.25", "2", "4"], (k) => { state.rate = [1, 0.5, 0.25, 2, 4][k]; }));
      play.addEventListener("click", () => run(!state.playing));
      slider.addEventListener("input", () => { run(false); move(Number(slider.value)); });
      run(false);
      begin(0);
    } else {
      place(data.posture);
    }

    // Mouse, touch and keys.
    const fingers = new Map();
    const clamp = () => {
      eye.tilt = Math.min(1.55, Math.max(-1.55, eye.tilt));
      eye.far = Math.min(size * 10, Math.max(size * 0.3, eye.far));
      draw();
    };
    canvas.addEventListener("pointerdown", (event) => { canvas.setPointerCapture(event.pointerId); fingers.set(event.pointerId, [event.clientX, event.clientY]); moved = 0; });
    let moved = 0;
    canvas.addEventListener("pointermove", (event) => {
      const old = fingers.get(event.pointerId);
      if (!old) return;
      const [dx, dy] = [event.clientX - old[0], event.clientY - old[1]];
      moved += Math.abs(dx) + Math.abs(dy);
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        eye.far *= Math.hypot(old[0] - other[0], old[1] - other[1]) / Math.max(1, Math.hypot(event.clientX - other[0], event.clientY - other[1]));
      } else if (event.shiftKey || event.buttons === 2) {
        const scale = eye.far / canvas.clientHeight / 2;
        const [s, c] = [Math.sin(eye.turn), Math.cos(eye.turn)];
        eye.at = [eye.at[0] + scale * dx * s, eye.at[1] - scale * dx * c, eye.at[2] + scale * dy];
      } else {
        eye.turn -= dx * 0.008;
        eye.tilt += dy * 0.008;
      }
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      clamp();
    });
    const up = (event) => {
      if (!fingers.delete(event.pointerId) || event.type !== "pointerup" || moved > 4) return;
      const box = canvas.getBoundingClientRect();
      const ray = new OGL.Raycast();
      ray.castMouse(camera, [(2 * (event.clientX - box.left)) / box.width - 1, 1 - (2 * (event.clientY - box.top)) / box.height]);
      const hits = ray.intersectMeshes(parts.flatMap(({ mesh }) => mesh ?? []), { cullFace: false, includeUV: false, includeNormal: false });
      const hit = hits.length ? parts.findIndex(({ mesh }) => mesh === hits[0]) : -1;
      choose(hit < 0 ? null : hit);
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      if (!event.ctrlKey && document.activeElement !== stage) return; // The page scrolls until the scene is chosen.
      event.preventDefault();
      eye.far *= Math.exp(event.deltaY * 0.001);
      clamp();
    }, { passive: false });
    stage.addEventListener("keydown", (event) => {
      const keys = {
        ArrowLeft: () => { eye.turn -= 0.1; }, ArrowRight: () => { eye.turn += 0.1; },
        ArrowUp: () => { eye.tilt += 0.1; }, ArrowDown: () => { eye.tilt -= 0.1; },
        "+": () => { eye.far /= 1.15; }, "=": () => { eye.far /= 1.15; }, "-": () => { eye.far *= 1.15; },
        0: () => back.click(), Escape: () => choose(null),
        " ": () => { if (data.motions.length) run(!state.playing); },
      };
      const act = keys[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
      clamp();
    });
    addEventListener("resize", draw);
    new MutationObserver(draw).observe(document.documentElement, { attributeFilter: ["data-theme"] });
    new ResizeObserver(draw).observe(holder);
    still.addEventListener("change", () => { if (still.matches) run(false); });
    addEventListener("beforeprint", () => run(false));

    holder.append(bar, stage, legend);
    if (data.motions.length) holder.append(film, gauges);
    holder.append(element("details", { open: !isLow && data.bodies.length <= 9 }, element("summary", {}, "Bodies"), list));
    holder.classList.add("live");
    paint();
    // For tests: poses of the bodies at positions of the joints.
    holder.posesAt = (q) => poses(data, q);
    holder.frames = () => render();
  };

  const scenes = [...document.querySelectorAll("script[data-scene]")];
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (!isIntersecting) continue;
      seen.unobserve(target);
      show(target, JSON.parse(scenes.find((script) => script.dataset.scene === target.id).textContent));
    }
  }, { rootMargin: "200px" });
  scenes.forEach((script) => seen.observe(document.getElementById(script.dataset.scene)));
})();
