"use strict";
// Figures as words, and the drawings. Whatever has a name in the document comes from strangers: it only ever becomes text.

const FATES = new Map(JSON.parse(document.getElementById("fates").textContent).map((fate) => [fate.name, fate]));
const NS_PER_MS = 1e6;

// As syncrelay.printable: what moves, hides or reorders text is shown as its number.
function printable(text) {
  return String(text).replace(/[^\P{C}]|(?! )\p{Z}/gu, (each) => `\\u{${each.codePointAt(0).toString(16)}}`);
}

function element(name, attributes = {}, ...children) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children.map((child) => (child instanceof Node ? child : printable(child))));
  return made;
}

function drawn(name, attributes = {}, ...children) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  made.append(...children.map((child) => (child instanceof Node ? child : printable(child))));
  return made;
}

// As syncrelay.explain.words: three digits that count.
function figure(number) {
  const size = Math.abs(number);
  return String(Number(number.toFixed(size >= 99.95 ? 0 : size >= 9.995 ? 1 : 2)));
}

function duration(ms) {
  if (ms === null || ms === undefined) return "–";
  const size = Math.abs(ms);
  if (size >= 999.5) return ms < 0 ? `-${seconds(size / 1000)}` : seconds(size / 1000);
  if (size === 0) return "0 s";
  return size >= 0.9995 ? `${figure(ms)} ms` : `${figure(ms * 1000)} us`;
}

function seconds(count) {
  if (count < 100) return `${count >= 9.95 ? Math.round(count) : figure(count)} s`;
  if (count < 6000) return `${Math.round(count / 60)} min`;
  return count < 172800 ? `${figure(count / 3600)} h` : `${Math.round(count / 86400)} days`;
}

function sparkline(label, values, sample) {
  const most = Math.max(...values, 1e-9);
  const last = Math.max(1, values.length - 1);
  const points = values.map((value, at) => `${(at / last * 100).toFixed(2)} ${(40 - value / most * 38).toFixed(2)}`);
  const text = `${label}: p50 ${duration(sample.p50)}, p95 ${duration(sample.p95)}, max ${duration(sample.max)}`;
  return element("div", {class: "spark"}, element("p", {}, text),
    drawn("svg", {viewBox: "0 0 100 40", preserveAspectRatio: "none", role: "img", "aria-label": `${label} of the last ${values.length} sets`},
      drawn("path", {d: `M0 40L${points.join("L")}L100 40Z`})));
}

// The newest stamp is on the right; so much time is shown that sets are apart.
const LANE = 34, APART = 18, LETTER = 7.2, LABEL_SHARE = 0.27;

function lanes(group, width) {
  const shifts = group.inputs.map((input) => input.offset_ms * NS_PER_MS);
  const recent = group.recent.map((each) => each.set
    ? {stamps: each.set.map((stamp, at) => (stamp === null ? null : stamp + shifts[at]))}
    : {stamp: each.drop.stamp + shifts[each.drop.input], input: each.drop.input, reason: each.drop.unneeded ? "unneeded" : each.drop.reason});
  const times = recent.flatMap((each) => each.stamps ? each.stamps.filter((stamp) => stamp !== null) : [each.stamp]);
  const longest = Math.max(...group.inputs.map((input) => printable(input.topic).length));
  const label = Math.min((longest + 1) * LETTER, width * LABEL_SHARE);
  const head = Math.max(...times), room = Math.max(1, width - label - 12);
  const shown = windowOf(recent, head - Math.min(...times), room);
  const x = (stamp) => width - 8 - (head - stamp) / shown * room;
  const isShown = (stamp) => stamp !== null && head - stamp <= shown;
  const y = (lane) => LANE / 2 + lane * LANE;
  const height = group.inputs.length * LANE + 16;
  const picture = drawn("svg", {viewBox: `0 0 ${width} ${height}`, height, role: "img"});
  group.inputs.forEach((input, lane) => {
    picture.append(drawn("line", {class: "rail", x1: label, x2: width, y1: y(lane), y2: y(lane)}),
      drawn("text", {x: 0, y: y(lane) + 4}, shortened(input.topic, Math.floor(label / LETTER)), drawn("title", {}, input.topic)));
  });
  const reasons = new Map();
  for (const each of recent.filter((one) => !one.stamps && isShown(one.stamp))) {
    reasons.set(each.reason, (reasons.get(each.reason) ?? 0) + 1);
    picture.append(mark(each.reason, x(each.stamp), y(each.input)));
  }
  const sets = recent.filter((each) => each.stamps);
  const before = group.sets - sets.length;
  let drawnSets = 0, labelled = -Infinity;
  sets.forEach((each, at) => {
    const places = each.stamps.map((stamp, lane) => [stamp, lane]).filter(([stamp]) => isShown(stamp));
    if (!places.length) return;
    drawnSets += 1;
    const points = places.map(([stamp, lane]) => [x(stamp).toFixed(1), y(lane)]);
    const one = drawn("g", {class: `set${(before + at) % 4}`}, drawn("path", {class: "joint", d: `M${points.map((point) => point.join(" ")).join("L")}`}));
    for (const [cx, cy] of points) one.append(drawn("circle", {class: "stamp", cx, cy, r: 4.5}));
    picture.append(one);
    const there = each.stamps.filter((stamp) => stamp !== null);
    const place = x(Math.max(...there));
    if (place - labelled > 44 && place < width - 4) {
      labelled = place;
      picture.append(drawn("text", {class: "faint", x: place, y: height - 3, "text-anchor": place > width - 30 ? "end" : "middle"},
        figure((Math.max(...there) - Math.min(...there)) / NS_PER_MS)));
    }
  });
  if (drawnSets) picture.append(drawn("text", {class: "faint", x: 0, y: height - 3}, "span in ms"));
  const dropped = [...reasons.values()].reduce((sum, count) => sum + count, 0);
  picture.setAttribute("aria-label", `${drawnSets} sets and ${dropped} dropped messages of the last ${duration(shown / NS_PER_MS)}`);
  return {picture, reasons: [...reasons.keys()], hasSets: drawnSets > 0, shown: shown / NS_PER_MS};
}

// Without sets the slowest input sets the pace, as it does with them; what its clock shows is drawn nonetheless.
function windowOf(recent, oldest, room) {
  const sets = recent.filter((each) => each.stamps).map((each) => Math.max(...each.stamps.filter((stamp) => stamp !== null)));
  const inputs = new Set(recent.filter((each) => !each.stamps).map((each) => each.input));
  const drops = [...inputs].map((input) => recent.filter((each) => each.input === input).map((each) => each.stamp));
  const heads = drops.map((stamps) => Math.max(...stamps));
  const gap = sets.length ? medianGap(sets) : Math.max(0, ...drops.map(medianGap));
  const wanted = gap ? gap * room / APART : oldest;
  const reaching = sets.length ? 0 : (Math.max(...heads) - Math.min(...heads)) * 1.2;
  return Math.max(NS_PER_MS, Math.min(Math.max(wanted, reaching), 600e9, oldest * 1.02 || NS_PER_MS));
}

function medianGap(stamps) {
  const sorted = [...stamps].sort((one, other) => one - other);
  const gaps = sorted.slice(1).map((stamp, at) => stamp - sorted[at]).filter((gap) => gap > 0).sort((one, other) => one - other);
  return gaps[gaps.length >> 1] ?? 0;
}

function mark(name, x, y) {
  const fate = FATES.get(name);
  if (!fate) return drawn("g");
  return drawn("path", {class: `shape ${fate.filled ? "filled" : "stroked"} fate-${name}`, d: fate.path, transform: `translate(${x.toFixed(1)} ${y})`});
}

function legend(reasons, hasSets) {
  return element("div", {class: "keys"}, ...(hasSets ? [element("span", {}, "joined: a set")] : []), ...reasons.map((reason) => element("span", {},
    drawn("svg", {viewBox: "-5 -5 10 10", "aria-hidden": "true"}, mark(reason, 0, 0)), ` ${FATES.get(reason)?.meaning ?? `${reason}: dropped`}`)));
}

// The end of a topic tells more than its begin.
function shortened(text, most) {
  const shown = printable(text);
  return shown.length <= most ? shown : `…${shown.slice(1 - most)}`;
}
