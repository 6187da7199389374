// The messages of a group on a line of time: marks and sets where there is room for them, columns where there is not.

const ROOM = 5;  // CSS pixels that a mark needs
const COLUMN = 3;
const MATCHED = 0;
const UNNEEDED = 1;

// The place of the first value that is not below a bound, in values that rise.
function firstNotBelow(values, bound) {
  let low = 0, high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < bound) low = middle + 1; else high = middle;
  }
  return low;
}

class LaneDrawing {
  constructor(timeline, fates, {isOverview}) {
    this.timeline = timeline;
    this.fates = fates.map((fate) => ({...fate, shape: new Path2D(fate.path)}));
    this.isOverview = isOverview;
  }

  middleOf(plot, lane) {
    const {top, height} = plot.bbox;
    const share = this.isOverview ? 0.5 : 0.6;
    return top + height * (lane + share) / this.timeline.lanes.length;
  }

  draw(plot) {
    const {ctx, bbox} = plot;
    this.scale = devicePixelRatio;
    this.colours = this.fates.map(({name}) => colour(name));
    this.from = plot.scales.x.min * SECOND;
    this.to = plot.scales.x.max * SECOND;
    this.toPixels = (time) => bbox.left + bbox.width * (time - this.from) / (this.to - this.from);
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    this.shadeWhatIsLeftOut(plot);
    if (!this.isOverview) this.drawSets(plot);
    this.timeline.lanes.forEach((lane, at) => this.drawLane(plot, lane, at));
    ctx.restore();
  }

  drawLane(plot, {topic, times, fates}, at) {
    const {ctx, bbox} = plot;
    const first = firstNotBelow(times, this.from), last = firstNotBelow(times, this.to);
    const middle = this.middleOf(plot, at);
    const room = bbox.width / this.scale / Math.max(1, last - first);
    if (this.isOverview || room < ROOM) this.drawColumns(plot, times, fates, first, last, middle);
    else this.drawMarks(ctx, times, fates, first, last, middle);
    if (!this.isOverview) this.drawName(plot, topic, at);
  }

  drawName({ctx, bbox}, topic, at) {
    ctx.font = `${12 * this.scale}px ui-monospace, monospace`;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    const top = bbox.top + bbox.height * at / this.timeline.lanes.length;
    const width = ctx.measureText(topic).width;
    const height = 16 * this.scale;
    ctx.globalAlpha = 0.85;
    ctx.fillStyle = colour("paper");
    ctx.fillRect(bbox.left, top + 1, width + 8 * this.scale, height);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colour("ink");
    ctx.fillText(topic, bbox.left + 4 * this.scale, top + height - 4 * this.scale);
  }

  drawMarks(ctx, times, fates, first, last, middle) {
    // All of one fate at once: a change of colour costs more than a shape.
    this.fates.forEach(({shape, filled}, fate) => {
      ctx.fillStyle = ctx.strokeStyle = this.colours[fate];
      ctx.lineWidth = 1.6;
      for (let at = first; at < last; at++) {
        if (fates[at] !== fate) continue;
        ctx.setTransform(this.scale, 0, 0, this.scale, this.toPixels(times[at]), middle);
        if (filled) ctx.fill(shape); else ctx.stroke(shape);
      }
    });
    ctx.setTransform(1, 0, 0, 1, 0, 0);
  }

  drawColumns(plot, times, fates, first, last, middle) {
    const {ctx, bbox} = plot;
    const width = COLUMN * this.scale;
    const columns = Math.ceil(bbox.width / width);
    const counts = this.fates.map(() => new Uint32Array(columns));
    const totals = new Uint32Array(columns);
    for (let at = first; at < last; at++) {
      const column = Math.min(columns - 1, Math.max(0, Math.floor((this.toPixels(times[at]) - bbox.left) / width)));
      counts[fates[at]][column]++;
      totals[column]++;
    }
    const most = Math.max(1, ...totals);
    const full = bbox.height / this.timeline.lanes.length * (this.isOverview ? 0.86 : 0.6);
    const ground = new Float64Array(columns).fill(middle + full / 2);
    counts.forEach((of, fate) => {
      ctx.fillStyle = this.colours[fate];
      of.forEach((count, column) => {
        if (!count) return;
        const height = full * count / most;
        ground[column] -= height;
        ctx.fillRect(bbox.left + column * width, ground[column], width - (fate ? 1 : 0), height);
      });
    });
  }

  drawSets(plot) {
    const {ctx, bbox} = plot;
    const {begins, spans, members, lanes} = this.timeline;
    // A set that began before what is shown may reach into it.
    const first = Math.max(0, firstNotBelow(begins, this.from) - 2), last = firstNotBelow(begins, this.to);
    if ((last - first) * 4 > bbox.width / this.scale) return;
    ctx.strokeStyle = this.colours[MATCHED];
    ctx.globalAlpha = 0.55;
    ctx.lineWidth = 2 * this.scale;
    for (let set = first; set < last; set++) {
      ctx.beginPath();
      lanes.forEach(({times}, lane) => {
        const place = members[lane][set];
        if (place >= 0) ctx.lineTo(this.toPixels(times[place]), this.middleOf(plot, lane));
      });
      ctx.stroke();
    }
    ctx.globalAlpha = 1;
  }

  shadeWhatIsLeftOut({ctx, bbox}) {
    const {each, stretch} = this.timeline;
    if (each === 1) return;
    ctx.fillStyle = colour("raised");
    const round = each * stretch;
    for (let begin = Math.floor(this.from / round) * round; begin < this.to; begin += round) {
      const left = this.toPixels(begin + stretch);
      ctx.fillRect(left, bbox.top, this.toPixels(begin + round) - left, bbox.height);
    }
  }

  // What stands nearest to a point of the drawing, in CSS pixels: a lane and a place in it.
  nearest(plot, left, top) {
    const {lanes} = this.timeline;
    const lane = Math.min(lanes.length - 1, Math.max(0, Math.floor(top / (plot.over.clientHeight / lanes.length))));
    const {times} = lanes[lane];
    if (!times.length) return null;
    const time = plot.posToVal(left, "x") * SECOND;
    const after = firstNotBelow(times, time);
    const place = after > 0 && (after === times.length || time - times[after - 1] < times[after] - time) ? after - 1 : after;
    return {lane, place};
  }
}
