// Puts the drawings in their places, and has keys, buttons and the mouse choose what part of a recording is shown.

const SETS_AT_FIRST = 12;
// Room for a number below either end.
const LANE_PADDING = [14, 16, 0, 14];
const KEYS = {
  ArrowLeft: "earlier", ArrowRight: "later", "+": "in", "=": "in", "-": "out", 0: "all", Home: "first", End: "last",
  n: "next", p: "previous",
};

class Timeline {
  constructor(section, drawn, timeline, fates) {
    this.section = section;
    this.timeline = timeline;
    this.fates = fates;
    const last = Math.max(0, ...timeline.lanes.map(({times}) => times.at(-1) ?? 0), drawn.duration);
    const first = Math.min(0, ...timeline.lanes.map(({times}) => times[0] ?? 0));
    const margin = Math.max(1, (last - first) / 200);
    this.bounds = [(first - margin) / SECOND, (last + margin) / SECOND];
    this.chosen = null;
    this.shown = this.firstShown();
    this.overview = this.drawWhole(".overview", 26 * timeline.lanes.length + 66);
    this.detail = this.drawDetail();
    const {begins, spans, latencies} = timeline;
    this.wholes = [
      this.overview, this.drawValues(".spans", begins, spans, "curve"), this.drawValues(".latencies", begins, latencies, "second"),
    ].filter(Boolean);
    this.listen();
  }

  // Few enough to see single sets, from the middle of the recording.
  firstShown() {
    const {begins} = this.timeline;
    const [low, high] = this.bounds;
    if (begins.length < SETS_AT_FIRST) return [low, high];
    const length = (begins.at(-1) - begins[0]) / begins.length * SETS_AT_FIRST / SECOND;
    const middle = begins[begins.length >> 1] / SECOND;
    return [Math.max(low, middle - length / 2), Math.min(high, middle + length / 2)];
  }

  drawDetail() {
    const place = this.section.querySelector(".lanes");
    const drawing = this.drawing = new LaneDrawing(this.timeline, this.fates, {isOverview: false});
    return plotIn(place, 76 * this.timeline.lanes.length + 66, {
      padding: LANE_PADDING,
      cursor: {
        x: true, y: false, points: {show: false}, drag: {x: true, y: false, setScale: false},
        bind: {dblclick: () => () => { this.show(this.bounds); return null; }},
      },
      scales: {x: {time: false, auto: false, range: () => this.shown}, y: {range: [0, 1]}},
      axes: [axis("seconds since the recording began"), {show: false}],
      series: [{}, {show: false}],
      hooks: {
        draw: [(plot) => { drawing.draw(plot); this.ring(plot); }],
        setSelect: [(plot) => this.select(plot)],
        setCursor: [(plot) => this.point(plot)],
      },
    }, [this.bounds, [null, null]]);
  }

  drawWhole(name, height) {
    const place = this.section.querySelector(name);
    const drawing = new LaneDrawing(this.timeline, this.fates, {isOverview: true});
    return plotIn(place, height, this.whole([axis("seconds since the recording began"), {show: false}], {
      padding: LANE_PADDING, series: [{}, {show: false}], scale: {range: [0, 1]}, draw: (plot) => drawing.draw(plot),
    }), [this.bounds, [null, null]]);
  }

  drawValues(name, begins, values, ink) {
    const place = this.section.querySelector(name);
    if (!place || !begins.length) return null;
    let most = 0;
    values.forEach((value) => { most = Math.max(most, value); });
    const [size, unit] = most ? unitOf(most / 2) : [1e6, "ms"];
    return plotIn(place, 200, this.whole([axis("seconds since the recording began"), axis(unit, {size: 60})], {
      series: [{}, {stroke: () => colour(ink), width: 1.2, points: {show: begins.length < 400, size: 4, fill: () => colour(ink)}}],
      scale: {range: (plot, low, high) => [0, high * 1.05 || 1]}, draw: () => {},
    }), [Array.from(begins, (begin) => begin / SECOND), Array.from(values, (value) => value / size)]);
  }

  // The options of a drawing of the whole recording, with a frame around what the lanes show.
  whole(axes, {scale, draw, ...options}) {
    return {
      ...options, axes,
      cursor: {
        y: false, points: {show: false}, drag: {x: true, y: false, setScale: false},
        bind: {dblclick: () => () => { this.show(this.bounds); return null; }},
      },
      scales: {x: {time: false, auto: false, range: () => this.bounds}, y: scale},
      hooks: {
        draw: [(plot) => { draw(plot); this.frame(plot); }],
        setSelect: [(plot) => this.select(plot)],
      },
    };
  }

  frame({ctx, bbox, valToPos}) {
    const [left, right] = this.shown.map((at) => valToPos(at, "x", true));
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = colour("ink");
    ctx.lineWidth = 1.5 * devicePixelRatio;
    ctx.strokeRect(left, bbox.top, Math.max(right - left, 2 * devicePixelRatio), bbox.height);
    ctx.globalAlpha = 0.08;
    ctx.fillRect(left, bbox.top, Math.max(right - left, 2 * devicePixelRatio), bbox.height);
    ctx.restore();
  }

  ring(plot) {
    if (!this.chosen) return;
    const {lane, place} = this.chosen, scale = devicePixelRatio;
    const x = plot.valToPos(this.timeline.lanes[lane].times[place] / SECOND, "x", true);
    if (x < plot.bbox.left || x > plot.bbox.left + plot.bbox.width) return;
    plot.ctx.save();
    plot.ctx.strokeStyle = colour("ink");
    plot.ctx.lineWidth = 2 * scale;
    plot.ctx.beginPath();
    plot.ctx.arc(x, this.drawing.middleOf(plot, lane), 9 * scale, 0, 7);
    plot.ctx.stroke();
    plot.ctx.restore();
  }

  select(plot) {
    const {left, width} = plot.select;
    if (width < 3) return;
    this.show([plot.posToVal(left, "x"), plot.posToVal(left + width, "x")]);
    plot.setSelect({left: 0, width: 0, top: 0, height: 0}, false);
  }

  show([low, high]) {
    const [least, most] = this.bounds;
    const length = Math.min(Math.max(high - low, 1e-6), most - least);
    const begin = Math.min(Math.max(low, least), most - length);
    this.shown = [begin, begin + length];
    this.detail?.setScale("x", {min: this.shown[0], max: this.shown[1]});
    this.wholes?.forEach((plot) => plot.redraw(false));
  }

  zoom(factor, at = (this.shown[0] + this.shown[1]) / 2) {
    this.show(this.shown.map((edge) => at + (edge - at) * factor));
  }

  move(share) {
    const step = (this.shown[1] - this.shown[0]) * share;
    this.show(this.shown.map((edge) => edge + step));
  }

  do(what) {
    const [low, high] = this.shown, [least, most] = this.bounds;
    const actions = {
      earlier: () => this.move(-0.25), later: () => this.move(0.25), in: () => this.zoom(0.5), out: () => this.zoom(2),
      all: () => this.show(this.bounds), first: () => this.show([least, least + high - low]),
      last: () => this.show([most - high + low, most]), next: () => this.step(1), previous: () => this.step(-1),
    };
    actions[what]();
  }

  // The next message, one way or the other, that was needed and went into no set.
  step(way) {
    const from = this.chosen ? this.timeline.lanes[this.chosen.lane].times[this.chosen.place] : this.shown[0] * SECOND;
    let best = null;
    this.timeline.lanes.forEach(({times, fates}, lane) => {
      let place = way > 0 ? firstNotBelow(times, from) : firstNotBelow(times, from + 1) - 1;
      const isPast = () => this.chosen && times[place] === from && way * (lane - this.chosen.lane) <= 0;
      while (place >= 0 && place < times.length && (fates[place] <= UNNEEDED || isPast())) place += way;
      if (place < 0 || place >= times.length) return;
      if (!best || way * (times[place] - best.time) < 0) best = {lane, place, time: times[place]};
    });
    if (!best) return this.say("No further message is missing from a set.");
    this.chosen = best;
    const at = best.time / SECOND, [low, high] = this.shown;
    if (at < low || at > high) this.show([at - (high - low) / 2, at + (high - low) / 2]);
    else this.detail.redraw(false);
    this.say(this.told(best));
  }

  point(plot) {
    const {left, top} = plot.cursor;
    const found = left >= 0 ? this.drawing.nearest(plot, left, top) : null;
    if (found && Math.abs(plot.valToPos(this.timeline.lanes[found.lane].times[found.place] / SECOND, "x") - left) < 12) {
      this.say(this.told(found));
    }
  }

  told({lane, place}) {
    const {lanes, members, spans, latencies} = this.timeline;
    const {topic, times, fates} = lanes[lane];
    const at = `${topic} at ${(times[place] / SECOND).toFixed(6)} s`;
    if (fates[place] !== MATCHED) return `${at}: no set, ${this.fates[fates[place]].word}`;
    const set = members[lane].indexOf(place);
    return set < 0 ? `${at}: in a set` : `${at}: in a set of span ${duration(spans[set])}, latency ${duration(latencies[set])}`;
  }

  say(text) {
    this.section.querySelector(".readout").value = text;
  }

  listen() {
    const lanes = this.section.querySelector(".lanes");
    this.section.querySelectorAll("[data-do]").forEach((button) => {
      button.addEventListener("click", () => this.do(button.dataset.do));
    });
    lanes.addEventListener("keydown", (event) => {
      if (event.ctrlKey || event.altKey || event.metaKey || !(event.key in KEYS)) return;
      event.preventDefault();
      this.do(KEYS[event.key]);
    });
    // The wheel alone scrolls the page; a pinch comes as a wheel with Ctrl.
    lanes.addEventListener("wheel", (event) => {
      if (!event.ctrlKey) return;
      event.preventDefault();
      const left = event.clientX - this.detail.over.getBoundingClientRect().left;
      this.zoom(event.deltaY > 0 ? 1.25 : 0.8, this.detail.posToVal(left, "x"));
    }, {passive: false});
  }
}

async function drawGroup(section, drawn, fates) {
  const timeline = new Timeline(section, drawn, await unpackTimeline(drawn.timeline), fates);
  section.querySelectorAll(".histogram").forEach((place) => {
    drawHistogram(place, drawn.histograms[Number(place.dataset.pair)], drawn.slops);
  });
  await Promise.all(Array.from(section.querySelectorAll(".mapping"), (place) => (
    drawMapping(place, drawn.mappings[Number(place.dataset.input)])
  )));
  const bySlop = section.querySelector(".by-slop"), byQueue = section.querySelector(".by-queue");
  if (bySlop) drawBySlop(bySlop, drawn.by_slop, drawn.slops);
  if (byQueue) drawByQueue(byQueue, drawn.by_queue_size, drawn.sizes);
  return timeline;
}

async function start() {
  const {fates, groups} = JSON.parse(document.getElementById("drawings").textContent);
  const sections = document.querySelectorAll("section.group");
  await Promise.all(groups.map((drawn, at) => drawGroup(sections[at], drawn, fates)));
  document.documentElement.dataset.drawn = String(plots.length);
}

// What is folded is printed too.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => each.open = true));

start();
