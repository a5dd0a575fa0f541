"use strict";
(() => {
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  // Maximum number of samples with markers, as in the static pictures.
  const marked = 250;
  const theme = (name) => { root.dataset.theme = name; };
  theme(dark.matches ? "dark" : "light");

  // Sorts a column numerically if all cells are numbers, otherwise alphabetically.
  for (const table of document.querySelectorAll("table")) {
    table.querySelectorAll("th").forEach((head, column) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...head.childNodes);
      head.append(button);
      button.addEventListener("click", () => {
        const body = table.tBodies[0];
        const down = head.getAttribute("aria-sort") !== "ascending";
        table.querySelectorAll("th").forEach((other) => other.removeAttribute("aria-sort"));
        head.setAttribute("aria-sort", down ? "ascending" : "descending");
        const key = (row) => row.cells[column].textContent.trim().replace("−", "-");
        const value = head.classList.contains("number") ? (row) => parseFloat(key(row)) : key;
        const order = (a, b) => {
          const [x, y] = [value(a), value(b)];
          if (typeof x === "string") return x.localeCompare(y);
          return Number.isNaN(x) ? 1 : Number.isNaN(y) ? -1 : x - y;
        };
        const rows = [...body.rows].sort(order);
        body.append(...(down ? rows : rows.reverse()));
      });
    });
  }

  const short = (value) => (value == null ? "–" : Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? (+value.toPrecision(4)).toExponential() : String(+value.toPrecision(5)));
  const style = (name) => getComputedStyle(root).getPropertyValue(name).trim();
  const colour = (number) => style(`--c${number % 8}`);

  // Error bars, drawn over the curves.
  const whiskers = (curves) => (plot) => {
    const pen = plot.ctx;
    pen.save();
    pen.beginPath();
    pen.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
    pen.clip();
    curves.forEach((curve, number) => {
      if (!curve.bars || !plot.series[number + 1].show) return;
      pen.strokeStyle = colour(number);
      pen.lineWidth = 1.5 * devicePixelRatio;
      pen.beginPath();
      plot.data[0].forEach((x, i) => {
        const [low, high] = [curve.bars[0][i], curve.bars[1][i]];
        if (curve.y[i] == null || high == null) return;
        const at = plot.valToPos(x, "x", true);
        const top = plot.valToPos(high, "y", true);
        const bottom = low == null ? plot.bbox.top + plot.bbox.height : plot.valToPos(low, "y", true);
        const cap = 4 * devicePixelRatio;
        pen.moveTo(at, top); pen.lineTo(at, bottom);
        for (const y of [top, bottom]) { pen.moveTo(at - cap, y); pen.lineTo(at + cap, y); }
      });
      pen.stroke();
    });
    pen.restore();
  };

  addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((fold) => { fold.open = true; }));
  // Shaded intervals, below the curves.
  const shades = (intervals) => (plot) => {
    const pen = plot.ctx;
    const { left, top, width, height } = plot.bbox;
    pen.save();
    pen.beginPath();
    pen.rect(left, top, width, height);
    pen.clip();
    pen.globalAlpha = 0.15;
    pen.fillStyle = style("--warning");
    intervals.forEach((ends) => {
      const [from, to] = ends.map((x) => plot.valToPos(x, "x", true));
      pen.fillRect(from, top, to - from, height);
    });
    pen.restore();
  };

  const plots = [];
  const width = (holder) => Math.max(holder.clientWidth, 280);
  // The curves and the strip with their difference; both zoom together.
  const draw = (entry) => {
    const { holder, data } = entry;
    const shown = entry.plot ? entry.plot.series.slice(1).map((series) => series.show) : [];
    [entry.plot, entry.strip].forEach((plot) => plot && plot.destroy());
    const [ink, line] = [style("--ink"), style("--line")];
    const axis = (label, extra) => ({ label, labelSize: 22, stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, ...extra });
    const numbers = (_, values) => values.map((value) => (value == null ? "" : short(value)));
    const points = (fill) => (data.x.length <= marked ? { show: true, size: 5, fill, stroke: fill } : { show: false });
    const series = data.curves.map((curve, number) => {
      const own = colour(number);
      return {
        label: curve.name,
        stroke: curve.broad ? own + "bf" : own,
        width: curve.points ? 0 : curve.broad ? 4.5 : 1.3,
        dash: curve.dashed ? [7, 4] : undefined,
        points: curve.points ? { show: true, size: 5, fill: own } : curve.broad ? { show: false } : points(own),
        paths: curve.points ? () => null : undefined,
        value: (_, value) => short(value),
        show: shown[number] ?? true,
      };
    });
    const whole = data.counts ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000] } : {};
    const room = data.counts ? { range: (_, low, high) => [low - 0.3, high + 0.3] } : {};
    const bars = data.curves.flatMap((curve) => (curve.bars ? curve.bars.flat() : [])).filter((value) => value != null);
    const span = bars.length && !data.log
      ? { range: (_, low, high) => uPlot.rangeNum(Math.min(low, ...bars), Math.max(high, ...bars), 0.1, true) }
      : {};
    const cursor = { drag: { x: true, y: false }, sync: { key: holder.id } };
    const x = { label: data.x_label || "x", value: (_, value) => short(value) };
    entry.plot = new uPlot(
      {
        width: width(holder),
        height: Math.round(Math.min(360, Math.max(240, holder.clientWidth * 0.45))),
        scales: { x: { time: false, ...room }, y: data.log ? { distr: 3 } : span },
        axes: [axis(data.x_label, whole), axis(data.y_label, { size: 64, values: numbers })],
        series: [x, ...series],
        cursor,
        hooks: { drawClear: [shades(data.shaded || [])], draw: [whiskers(data.curves)] },
      },
      [data.x, ...data.curves.map((curve) => curve.y)],
      holder,
    );
    if (data.strip) {
      const [of, less] = data.strip.of.map((number) => data.curves[number].y);
      const own = colour(data.curves.length);
      entry.strip = new uPlot(
        {
          width: width(holder),
          height: 150,
          scales: { x: { time: false } },
          axes: [axis("", { size: 30, labelSize: 0 }), axis("difference", { size: 64, values: numbers, space: 22 })],
          series: [x, { label: data.strip.name, stroke: own, width: 1.2, points: points(own), value: (_, value) => short(value) }],
          cursor,
        },
        [data.x, of.map((value, i) => (value == null || less[i] == null ? null : value - less[i]))],
        holder,
      );
    }
    // A legend entry switches its curve, by key or click.
    holder.querySelectorAll(".u-legend .u-series th").forEach((head) => {
      head.tabIndex = 0;
      head.setAttribute("role", "button");
      head.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        head.click();
      });
    });
    holder.classList.add("live");
  };

  // Arrows move the shown range, + and - zoom, 0 or Escape shows all.
  const steer = (entry) => (event) => {
    if (event.target !== entry.holder || !entry.plot) return;
    const all = entry.data.x;
    const { min, max } = entry.plot.scales.x;
    const [span, middle] = [max - min, (min + max) / 2];
    const moves = {
      ArrowLeft: [min - span / 5, max - span / 5],
      ArrowRight: [min + span / 5, max + span / 5],
      "+": [middle - span / 3, middle + span / 3],
      "-": [middle - span, middle + span],
      0: [all[0], all[all.length - 1]],
      Escape: [all[0], all[all.length - 1]],
    };
    const to = moves[event.key === "=" ? "+" : event.key];
    if (!to || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    [entry.plot, entry.strip].forEach((plot) => plot && plot.setScale("x", { min: Math.max(to[0], all[0]), max: Math.min(to[1], all[all.length - 1]) }));
  };

  for (const script of document.querySelectorAll("script[data-plot]")) {
    const holder = document.getElementById(script.dataset.plot);
    const data = JSON.parse(script.textContent);
    if (!data.x.length || !data.curves.length) { holder.textContent = "no data"; continue; }
    const entry = { holder, data };
    holder.tabIndex = 0;
    holder.setAttribute("role", "group");
    holder.setAttribute("aria-label", `${holder.dataset.words}. Keys: arrows move, + and - zoom, 0 shows all.`);
    holder.addEventListener("keydown", steer(entry));
    plots.push(entry);
  }
  // Plots are drawn when they become visible, so that a long page opens quickly.
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const entry = plots.find((plot) => plot.holder === target);
      if (isIntersecting && !entry.plot) draw(entry);
    }
  }, { rootMargin: "400px" });
  plots.forEach((entry) => seen.observe(entry.holder));

  // A joint that is chosen in the picture of the robot hides the plots of the others.
  const filter = document.createElement("p");
  filter.className = "filter note";
  filter.setAttribute("role", "status");
  const ofJoints = [...document.querySelectorAll("section[data-joint]")];
  document.addEventListener("joint", ({ detail: joint }) => {
    const own = ofJoints.some((section) => section.dataset.joint === joint) ? joint : null;
    ofJoints.forEach((section) => { section.hidden = own !== null && section.dataset.joint !== own; });
    filter.replaceChildren();
    if (own === null) return filter.remove();
    const all = document.createElement("button");
    all.type = "button";
    all.textContent = "Show all joints";
    all.addEventListener("click", () => document.dispatchEvent(new CustomEvent("joint", { detail: null })));
    filter.append(`Plots of joint ${own} only. `, all);
    ofJoints[0].before(filter);
  });

  let waiting;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => plots.filter((entry) => entry.plot && Math.abs(entry.plot.width - width(entry.holder)) > 1).forEach(draw), 120);
  });
  const again = (name) => { theme(name); plots.filter((entry) => entry.plot).forEach(draw); };
  document.getElementById("theme").addEventListener("click", () => again(root.dataset.theme === "dark" ? "light" : "dark"));
  dark.addEventListener("change", () => again(dark.matches ? "dark" : "light"));
})();
