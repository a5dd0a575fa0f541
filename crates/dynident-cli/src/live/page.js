"use strict";
// Asks for the state five times a second and draws it. Only new samples of the current motion are sent.
(() => {
  const PERIOD_MS = 200;
  // Time after which a request counts as lost.
  const LIMIT_MS = 3000;
  const WIDTH = 360, HEIGHT = 150, LEFT = 52, BOTTOM = 18;
  const id = (name) => document.getElementById(name);
  const text = (name, words) => { if (id(name).textContent !== words) id(name).textContent = words; };
  const SVG = "http://www.w3.org/2000/svg";
  const element = (name, attributes, parent) => {
    const made = document.createElementNS(SVG, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    parent.append(made);
    return made;
  };
  const short = (value) => Number.isFinite(value) ? String(Number(value.toPrecision(3))) : "–";

  let motion = -1, head = null, rows = [], plots = [], joints = [], runs = "";

  const plot = (title, parent) => {
    const svg = element("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "img", "aria-label": title }, parent);
    const part = (kind) => element("path", { class: kind }, svg);
    const own = { svg, title, band: part("band"), back: part("desired"), front: part("measured") };
    element("path", { class: "frame", d: `M${LEFT} 4V${HEIGHT - BOTTOM}H${WIDTH - 4}` }, svg);
    own.marks = [["end", LEFT - 4, 14], ["end", LEFT - 4, HEIGHT - BOTTOM], ["start", LEFT, HEIGHT - 3], ["end", WIDTH - 4, HEIGHT - 3]]
      .map(([anchor, x, y]) => element("text", { x, y, "text-anchor": anchor }, svg));
    return own;
  };

  const build = (names) => {
    joints = names;
    id("plots").replaceChildren();
    plots = names.map((name) => {
      const section = document.createElement("section");
      const title = document.createElement("h3");
      title.textContent = name;
      section.append(title);
      id("plots").append(section);
      return [plot(`${name}: position, rad (m)`, section), plot(`${name}: torque, Nm (N)`, section)];
    });
  };

  // Lines over time; each is a list of times and one of values.
  const draw = (own, end, unit, back, front, half) => {
    let low = Infinity, high = -Infinity;
    const range = (values, grown) => values.forEach((value, k) => {
      const more = grown ? grown[k] : 0;
      low = Math.min(low, value - more);
      high = Math.max(high, value + more);
    });
    if (back) range(back[1], half);
    range(front[1]);
    if (!(low <= high)) [low, high] = [-1, 1];
    if (high - low < 1e-9) [low, high] = [low - 0.5e-3, high + 0.5e-3];
    const x = (t) => (LEFT + t / end * (WIDTH - LEFT - 4)).toFixed(1);
    const y = (value) => (HEIGHT - BOTTOM - (value - low) / (high - low) * (HEIGHT - BOTTOM - 6)).toFixed(1);
    const line = ([times, values], more) => times.map((t, k) => `${x(t)} ${y(values[k] + (more ? more[k] : 0))}`);
    const path = (points) => points.length ? `M${points.join("L")}` : "";
    own.back.setAttribute("d", back ? path(line(back)) : "");
    own.front.setAttribute("d", path(line(front)));
    own.band.setAttribute("d", back && half
      ? `${path([...line(back, half), ...line(back, half.map((value) => -value)).reverse()])}Z` : "");
    [short(high), short(low), `0 s; ${unit}`, `${short(end)} s`].forEach((words, k) => { own.marks[k].textContent = words; });
    const last = front[1].at(-1);
    own.svg.setAttribute("aria-label", `${own.title}; measured now: ${short(last)}`);
  };

  const desired = (joint, t) => {
    const { t: times, q } = head.desired;
    const at = Math.min(times.length - 2, Math.max(0, Math.floor(t / (times[1] - times[0]))));
    const share = Math.min(1, Math.max(0, (t - times[at]) / (times[at + 1] - times[at])));
    return q[joint][at] + share * (q[joint][at + 1] - q[joint][at]);
  };

  const show = (state) => {
    text("name", state.name);
    text("status", state.status);
    id("stop").disabled = state.stop_requested || state.ended;
    id("stopped").hidden = !state.stop_requested;
    if (state.head) {
      [head, rows, motion] = [state.head, [], state.motion];
      if (head.joints.join("\n") !== joints.join("\n")) build(head.joints);
    }
    rows = [...rows.slice(0, state.from), ...state.rows];
    if (head) {
      text("motion", state.part && state.part !== "motion" ? `${head.words} (${state.part})` : head.words);
      text("controller", head.controller);
      text("left", state.is_moving ? `${state.left_s.toFixed(1)} s` : "complete");
      id("progress").value = head.whole_s > 0 ? state.elapsed_s / head.whole_s : 0;
      const count = joints.length, times = rows.map((row) => row[0]);
      const column = (k) => rows.map((row) => row[k]);
      const row = rows.at(-1);
      const errors = row ? joints.map((_, j) => Math.abs(desired(j, row[0]) - row[1 + j])) : [];
      text("error", row ? `${short(Math.max(...errors))} rad (m)` : "–");
      plots.forEach(([position, torque], j) => {
        draw(position, head.duration_s, "rad (m)", [head.desired.t, head.desired.q[j]], [times, column(1 + j)]);
        const expected = head.expected;
        draw(torque, head.duration_s, "Nm (N)", expected && [expected.t, expected.tau[j]], [times, column(1 + count + j)], expected?.half[j]);
      });
    }
    const now = JSON.stringify(state.history);
    if (now !== runs && state.history.length) {
      runs = now;
      id("runs").replaceChildren(...state.history.map((run) => {
        const line = document.createElement("tr");
        for (const words of [run.run, run.accepted ? "accepted" : "rejected", run.controller, run.tracking.toExponential(2), run.outcome]) {
          const cell = document.createElement("td");
          cell.textContent = words;
          line.append(cell);
        }
        return line;
      }));
    }
    return state.ended;
  };

  const ask = async (path, options) => {
    const answer = await fetch(path, { cache: "no-store", signal: AbortSignal.timeout(LIMIT_MS), ...options });
    if (!answer.ok) throw new Error(answer.statusText);
    return answer.json();
  };

  const turn = async () => {
    let ended = false;
    try {
      ended = show(await ask(motion < 0 ? "state" : `state?motion=${motion}&from=${rows.length}`));
      id("lost").hidden = true;
    } catch {
      id("lost").hidden = false;
    }
    if (!ended) setTimeout(turn, id("lost").hidden ? PERIOD_MS : 5 * PERIOD_MS);
  };

  id("stop").addEventListener("click", () => {
    // The state shows whether the request has arrived.
    ask("stop", { method: "POST" }).then(() => { id("stopped").hidden = false; }, () => { id("lost").hidden = false; });
  });
  turn();
})();
