"use strict";
(() => {
  const root = document.documentElement;
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const colours = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b8930b", "#56b4e9", "#9a63d8", "#808890"];
  const theme = (name) => { root.dataset.theme = name; };
  theme(dark.matches ? "dark" : "light");

  // A column is sorted by its numbers if all its cells are numbers, else by its letters.
  for (const table of document.querySelectorAll("table")) {
    table.querySelectorAll("th").forEach((head, column) => head.addEventListener("click", () => {
      const body = table.tBodies[0];
      const down = head.dataset.sorted !== "up";
      table.querySelectorAll("th").forEach((other) => delete other.dataset.sorted);
      head.dataset.sorted = down ? "up" : "down";
      const key = (row) => row.cells[column].textContent.trim().replace("−", "-");
      const value = head.classList.contains("number") ? (row) => parseFloat(key(row)) : key;
      const order = (a, b) => {
        const [x, y] = [value(a), value(b)];
        if (typeof x === "string") return x.localeCompare(y);
        return Number.isNaN(x) ? 1 : Number.isNaN(y) ? -1 : x - y;
      };
      const rows = [...body.rows].sort(order);
      body.append(...(down ? rows : rows.reverse()));
    }));
  }

  const short = (value) => (value == null ? "–" : Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? (+value.toPrecision(4)).toExponential() : String(+value.toPrecision(5)));
  const style = (name) => getComputedStyle(root).getPropertyValue(name).trim();

  // Error bars, drawn over the curves.
  const whiskers = (curves) => (plot) => {
    const pen = plot.ctx;
    pen.save();
    pen.beginPath();
    pen.rect(plot.bbox.left, plot.bbox.top, plot.bbox.width, plot.bbox.height);
    pen.clip();
    curves.forEach((curve, number) => {
      if (!curve.bars || !plot.series[number + 1].show) return;
      pen.strokeStyle = colours[number % colours.length];
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

  const plots = [];
  const draw = (entry) => {
    const { holder, data } = entry;
    const shown = entry.plot ? entry.plot.series.slice(1).map((series) => series.show) : [];
    if (entry.plot) entry.plot.destroy();
    const [ink, line] = [style("--ink"), style("--line")];
    const axis = (label, extra) => ({ label, labelSize: 22, stroke: ink, grid: { stroke: line, width: 1 }, ticks: { stroke: line }, ...extra });
    const series = data.curves.map((curve, number) => {
      const colour = colours[number % colours.length];
      return {
        label: curve.name,
        stroke: colour,
        width: curve.points && !data.counts ? 0 : 1.5,
        dash: curve.dashed ? [7, 4] : undefined,
        points: curve.points || data.counts ? { show: true, size: 5, fill: colour } : { show: false },
        paths: curve.points && !data.counts ? () => null : undefined,
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
    entry.plot = new uPlot(
      {
        width: Math.max(holder.clientWidth, 280),
        height: Math.round(Math.min(360, Math.max(240, holder.clientWidth * 0.45))),
        scales: { x: { time: false, ...room }, y: data.log ? { distr: 3 } : span },
        axes: [axis(data.x_label, whole), axis(data.y_label, { size: 64, values: (_, values) => values.map((value) => (value == null ? "" : short(value))) })],
        series: [{ label: data.x_label || "x", value: (_, value) => short(value) }, ...series],
        cursor: { drag: { x: true, y: false } },
        hooks: { draw: [whiskers(data.curves)] },
      },
      [data.x, ...data.curves.map((curve) => curve.y)],
      holder,
    );
  };

  for (const script of document.querySelectorAll("script[data-plot]")) {
    const holder = document.getElementById(script.dataset.plot);
    const data = JSON.parse(script.textContent);
    if (!data.x.length || !data.curves.length) { holder.textContent = "no data"; continue; }
    plots.push({ holder, data });
  }
  // Only what comes into view is drawn: a long page opens at once.
  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      const entry = plots.find((plot) => plot.holder === target);
      if (isIntersecting && !entry.plot) draw(entry);
    }
  }, { rootMargin: "400px" });
  plots.forEach((entry) => seen.observe(entry.holder));
  addEventListener("beforeprint", () => plots.filter((entry) => !entry.plot).forEach(draw));

  let waiting;
  addEventListener("resize", () => {
    clearTimeout(waiting);
    waiting = setTimeout(() => plots.filter((entry) => entry.plot && Math.abs(entry.plot.width - Math.max(entry.holder.clientWidth, 280)) > 1).forEach(draw), 120);
  });
  const again = (name) => { theme(name); plots.filter((entry) => entry.plot).forEach(draw); };
  document.getElementById("theme").addEventListener("click", () => again(root.dataset.theme === "dark" ? "light" : "dark"));
  dark.addEventListener("change", () => again(dark.matches ? "dark" : "light"));
})();
