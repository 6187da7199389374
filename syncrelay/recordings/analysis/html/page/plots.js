// What all drawings share, and those that uPlot makes alone: histograms and curves.

const SECOND = 1e9;
const UNITS = [[1e9, "s"], [1e6, "ms"], [1e3, "us"], [1, "ns"]];
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const plots = [];

function duration(ns) {
  const [size, unit] = UNITS.find(([size]) => Math.abs(ns) >= size) ?? UNITS[3];
  return `${Number((ns / size).toPrecision(3))} ${unit}`;
}

function unitOf(ns) {
  return UNITS.find(([size]) => ns >= size) ?? UNITS[3];
}

// As few as tell every tick from the next: 2 for steps of 0.25.
function decimals(step) {
  let digits = 0;
  while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-6) digits++;
  return digits;
}

function axis(label, options = {}) {
  return {
    label, size: 34, labelSize: 18, labelFont: "12px system-ui, sans-serif", font: "12px system-ui, sans-serif",
    stroke: () => colour("faint"),
    grid: {stroke: () => colour("line"), width: 1},
    ticks: {stroke: () => colour("line"), width: 1, size: 5},
    values: (plot, splits, at, space, step) => splits.map((value) => value.toFixed(decimals(step))),
    ...options,
  };
}

// A plot as wide as its place, drawn anew when that or the scheme of colours changes.
function plotIn(place, height, options, data) {
  const plot = new uPlot({
    width: Math.max(200, place.clientWidth), height, legend: {show: false}, padding: [14, 12, 0, 0], ...options,
  }, data, place);
  new ResizeObserver(() => {
    if (place.clientWidth && place.clientWidth !== plot.width) plot.setSize({width: place.clientWidth, height});
  }).observe(place);
  plots.push(plot);
  return plot;
}

matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach((plot) => plot.redraw()));

// Upright lines with a word at the top; each [value, word, name of its colour, dash].
function drawMarks(plot, marks) {
  const {ctx, bbox} = plot, scale = devicePixelRatio;
  ctx.save();
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  ctx.font = `600 ${11 * scale}px system-ui, sans-serif`;
  ctx.lineWidth = 2 * scale;
  const taken = [];
  for (let [value, word, name, dash] of marks) {
    const x = plot.valToPos(value, "x", true);
    const isBeyond = x > bbox.left + bbox.width + 1;
    ctx.strokeStyle = ctx.fillStyle = colour(name);
    if (x >= bbox.left - 1 && !isBeyond) {
      ctx.setLineDash(dash.map((part) => part * scale));
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    if (!word) continue;
    word += isBeyond ? " \u2192" : "";
    const width = ctx.measureText(word).width;
    const left = Math.min(Math.max(x - width / 2, bbox.left), bbox.left + bbox.width - width);
    const row = taken.filter(([begin, end]) => left < end + 6 * scale && left + width > begin - 6 * scale).length;
    taken.push([left, left + width]);
    ctx.fillText(word, left, bbox.top - 4 * scale - row * 13 * scale);
  }
  ctx.restore();
}

function bothMarks({now, then}, text) {
  const marks = [];
  if (now !== null) marks.push([now, `in use ${text(now)}`, "now", []]);
  if (then !== null) marks.push([then, `suggested ${text(then)}`, "then", [6, 4]]);
  return marks;
}

function drawHistogram(place, {edges, counts}, slops) {
  const [size, unit] = unitOf(Math.max(-edges[0], edges.at(-1)) / 2);
  const middles = counts.map((_, at) => (edges[at] + edges[at + 1]) / 2 / size);
  const lines = bothMarks(slops, (slop) => `±${duration(slop)}`).flatMap(([slop, word, name, dash]) => (
    slop === 0 ? [[0, word, name, dash]] : [[-slop / size, "", name, dash], [slop / size, word, name, dash]]
  ));
  plotIn(place, 210, {
    padding: [30, 12, 0, 0],
    cursor: {drag: {x: true, y: false}},
    scales: {x: {time: false}, y: {range: (plot, low, high) => [0, Math.max(1, high * 1.05)]}},
    axes: [axis(`offset, ${unit}`), axis("messages", {size: 60})],
    series: [{}, {
      stroke: () => colour("curve"), fill: () => colour("curve"), width: 0, points: {show: false},
      paths: uPlot.paths.bars({size: [0.92, 100]}),
    }],
    hooks: {draw: [(plot) => drawMarks(plot, lines)]},
  }, [middles, counts]);
}

// A device's stamps against times of receipt, the line that they were mapped to, and where its clock was set.
async function drawMapping(place, {times, stamps, line, begins, between, steps}) {
  const [at, points, mapped] = await Promise.all([times, stamps, line].map(unpack));
  const [low, high] = between, margin = Math.max((high - low) / 12, 1000);
  const [size, unit] = unitOf(Math.max(-low, high, margin));
  const marks = steps.map(([when, by]) => (
    [when / SECOND, `set ${by > 0 ? "forward" : "back"} ${duration(Math.abs(by))}`, "now", [6, 4]]
  ));
  const heights = Array.from(mapped, (height) => height / size);
  // No line leads from one setting of the clock to the next.
  begins.forEach((begin) => { heights[begin] = null; });
  plotIn(place, 240, {
    padding: [30, 12, 0, 0],
    scales: {x: {time: false}, y: {range: [(low - margin) / size, (high + margin) / size]}},
    axes: [axis("seconds since the recording began"), axis(unit, {size: 60})],
    series: [{}, {
      paths: () => null, points: {show: true, size: 3, width: 0, fill: () => colour("curve")},
    }, {stroke: () => colour("second"), width: 2, points: {show: false}}],
    hooks: {draw: [(plot) => drawMarks(plot, marks)]},
  }, [Array.from(at, (time) => time / SECOND), Array.from(points, (height) => height / size), heights]);
}

const FROM_ZERO = {range: (plot, low, high) => [0, Math.max(1, high) * 1.04]};

// A point is a run of the engine; the lines only lead the eye from one to the next.
function curveSeries(name, dash, scale) {
  return {scale, stroke: () => colour(name), width: 2, dash, points: {show: true, size: 6, fill: () => colour(name)}};
}

function drawBySlop(place, points, slops) {
  const [size, unit] = unitOf(points.at(-1)[0] / 2);
  const spans = Math.max(...points.map(([, , span]) => span));
  const [spanSize, spanUnit] = unitOf(spans / 2);
  plotIn(place, 260, {
    padding: [30, 0, 0, 0],
    scales: {x: {time: false}, y: FROM_ZERO, span: {range: [0, Math.max(1, spans / spanSize) * 1.04]}},
    axes: [
      axis(`slop, ${unit}`), axis("sets, solid", {size: 60}),
      axis(`median span, ${spanUnit}, dotted`, {scale: "span", side: 1, size: 50, grid: {show: false}}),
    ],
    series: [{}, curveSeries("curve", [], "y"), curveSeries("second", [2, 4], "span")],
    hooks: {draw: [(plot) => drawMarks(plot, bothMarks(slops, duration).map(([at, ...rest]) => [at / size, ...rest]))]},
  }, [
    points.map(([slop]) => slop / size), points.map(([, sets]) => sets),
    points.map(([, sets, span]) => (sets ? span / spanSize : null)),
  ]);
}

function drawByQueue(place, points, sizes) {
  plotIn(place, 260, {
    padding: [30, 12, 0, 0],
    scales: {x: {time: false, range: (plot, low, high) => [Math.min(low, 0), high + 1]}, y: FROM_ZERO},
    axes: [axis("queue size", {incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500]}), axis("sets", {size: 60})],
    series: [{}, curveSeries("curve", [], "y")],
    hooks: {draw: [(plot) => drawMarks(plot, bothMarks(sizes, String))]},
  }, [points.map(([size]) => size), points.map(([, sets]) => sets)]);
}
