"use strict";
// Asks the relay once a second, as `syncrelay top` does, and shows what it says. Nothing is kept but the last answer.

const ASKS_EVERY_MS = 1000, PATIENCE_MS = 4000;
const LEVELS = ["error", "stale", "warn", "ok"];
const byName = (one, other) => (one.name < other.name ? -1 : one.name > other.name ? 1 : 0);
const ORDERS = {
  worst: (groups) => [...groups].sort((one, other) => LEVELS.indexOf(one.level) - LEVELS.indexOf(other.level) || byName(one, other)),
  file: (groups) => groups,
  name: (groups) => [...groups].sort(byName),
};
// Beside the list there is room for a group from this width on; below it, a group opens in its row.
const WIDE = matchMedia("(min-width: 1000px)");
const place = (id) => document.getElementById(id);
// Kept here, as the list that it may stand in is made anew.
const SECTION = place("group");
const keys = new WeakMap();
let state = null, order = "worst", frozen = false, sought = "", answered = performance.now(), trouble = null;
let chosen = hashed(), closed = !WIDE.matches && !chosen;

function hashed() {
  try {
    return decodeURIComponent(location.hash.slice(1));
  } catch {
    return "";
  }
}

// What has not changed stays, so that text can be selected and copied.
function fill(where, content, make) {
  const key = JSON.stringify(content);
  if (keys.get(where) === key) return;
  keys.set(where, key);
  where.replaceChildren(...make());
}

async function ask() {
  if (!document.hidden && !frozen) {
    try {
      const answer = await fetch("status", {cache: "no-store", signal: AbortSignal.timeout(PATIENCE_MS)});
      if (!answer.ok) throw new Error((await answer.text()).slice(0, 500));
      take(await answer.json());
    } catch (error) {
      trouble = error.name === "TimeoutError" ? "it takes too long" : error instanceof TypeError ? "nothing answers there" : error.message;
    }
    try {
      show();
    } finally {
      setTimeout(ask, ASKS_EVERY_MS);
    }
  } else setTimeout(ask, ASKS_EVERY_MS);
}

// Where another version has been started, its own page is asked for.
function take(told) {
  if (!told?.relay || !Array.isArray(told.groups)) throw new Error("what answers there is not a relay");
  if (state !== null && told.relay.version !== state.relay.version) location.reload();
  [state, answered, trouble] = [told, performance.now(), null];
}

function show() {
  const quiet = (performance.now() - answered) / 1000;
  place("trouble").hidden = trouble === null;
  if (trouble !== null) fill(place("trouble"), [trouble, Math.round(quiet)], () => [printable(`STALE: no answer for ${seconds(quiet)}: ${trouble}; still trying`)]);
  if (state === null) return;
  const {relay} = state;
  const worst = LEVELS.find((level) => state.groups.some((group) => group.level === level)) ?? "warn";
  const level = trouble !== null ? "stale" : worst;
  document.title = `${level === "ok" ? "" : "✖ "}${printable(state.headline)} · ${printable(relay.node)}`;
  if (place("icon").dataset.level !== level) showIcon(level);
  place("headline").textContent = printable(state.headline);
  place("headline").className = `level ${level}`;
  place("node").textContent = printable(relay.node);
  const failed = relay.reload_error ? `; the last reload failed: ${relay.reload_error}` : "";
  place("relay").textContent = `${relay.phase}, ${relay.ready ? "ready" : "not ready"}, up ${seconds(relay.uptime_s)}, syncrelay ${printable(relay.version)}, ${printable(relay.config + failed)}`;
  showTroubles(state.troubles.filter((each) => each.groups.length > 1));
  const groups = listed();
  const group = groups.find((each) => each.name === chosen) ?? groups[0];
  showList(groups, group);
  showGroup(group);
  document.documentElement.dataset.shown = String(Number(document.documentElement.dataset.shown ?? 0) + 1);
}

// The tab says what the page says: its icon has the colour of the worst group.
function showIcon(level) {
  const icon = place("icon"), colour = getComputedStyle(document.documentElement).getPropertyValue(level === "stale" ? "--error" : `--${level}`);
  const mark = level === "ok" ? "<circle cx='8' cy='8' r='7'/>" : level === "warn" ? "<path d='M8 1l7 14H1z'/>" : "<path d='M1 1h14v14H1z'/>";
  icon.dataset.level = level;
  icon.href = `data:image/svg+xml,${encodeURIComponent(`<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 16 16' fill='${colour.trim()}'>${mark}</svg>`)}`;
}

// What the groups of a card suffer of is said of each of them, too: the card shows them alone.
function showTroubles(troubles) {
  fill(place("troubles"), troubles, () => troubles.map((each) => {
    const names = element("button", {type: "button", class: "names"}, `${each.groups.length} groups: ${each.groups.join(", ")}`);
    names.addEventListener("click", () => seek(sought === groupsOf(each) ? "" : groupsOf(each)));
    return element("article", {class: `note ${each.severity}`}, element("p", {}, element("strong", {class: `level ${each.severity}`}, `${each.severity.toUpperCase()} `), each.text),
      ...(each.suggestion ? [element("p", {class: "fix"}, ...withCode(each.suggestion))] : []), names);
  }));
}

function groupsOf({groups}) {
  return groups.join(" | ");
}

// The groups that hold what is sought; "a | b" are those of these names.
function listed() {
  const names = sought.includes(" | ") ? new Set(sought.split(" | ")) : null, text = sought.toLowerCase();
  const holds = (group) => [group.name, group.level, ...group.inputs.map((each) => each.topic), ...group.findings.flatMap((each) => [each.code.replaceAll("_", " "), each.text])].join("\n").toLowerCase().includes(text);
  return ORDERS[order](state.groups).filter((group) => (names ? names.has(group.name) : holds(group)));
}

function seek(text) {
  sought = place("filter").value = text;
  if (state) show();
}

function showList(groups, current) {
  fill(place("groups"), groups.map((group) => group.name), () => groups.map((group) => {
    const row = element("button", {type: "button", class: "group"}, element("strong", {}, group.name),
      element("span", {class: "level"}), element("span", {class: "figures"}), element("span", {class: "why"}));
    row.addEventListener("click", () => choose(group.name, true));
    return row;
  }));
  if (!groups.length) fill(place("groups"), ["none", sought], () => [element("p", {}, sought ? `no group has "${sought}"` : "no group is running yet: the relay starts, or its file has none")]);
  const rows = [...place("groups").querySelectorAll(".group")];
  groups.forEach((group, at) => {
    const row = rows[at], [, level, figures, why] = row.children;
    row.setAttribute("aria-current", String(group === current));
    if (WIDE.matches) row.removeAttribute("aria-expanded");
    else row.setAttribute("aria-expanded", String(group === current && !closed));
    row.className = `group ${group.level}`;
    level.className = `level ${group.level}`;
    level.textContent = group.level.toUpperCase();
    const shown = [`${ofPossible(group)} sets/s`, `span p95 ${duration(group.span_ms?.p95)}`, `latency p95 ${duration(group.latency_ms?.p95)}`];
    fill(figures, shown, () => shown.flatMap((each, index) => [index ? ", " : "", element("span", {}, each)]));
    const [finding] = group.findings;
    why.textContent = finding && group.level !== "ok" ? printable(finding.text) : "";
  });
}

const BLOCKS = ["head", "findings", "figures", "lanes", "inputs"];

function showGroup(group) {
  const section = SECTION, row = document.querySelector("#groups [aria-current=true]");
  // On a phone it is in the list, below its row.
  if (WIDE.matches || !row) { if (section.parentElement !== document.querySelector("main")) document.querySelector("main").append(section); }
  else if (section.previousElementSibling !== row) row.after(section);
  section.hidden = !group || (closed && !WIDE.matches);
  if (!group) return fill(section, null, () => []);
  fill(section, group.name, () => BLOCKS.map((name) => element("div", {class: name})));
  const [head, findings, figures, recent, inputs] = section.children;
  fill(head, [group.name, options(group)], () => [element("h2", {}, group.name), element("p", {class: "faint"}, options(group))]);
  fill(findings, group.findings, () => group.findings.map(finding));
  fill(figures, [group.sets, group.rate_hz, group.possible_hz, group.since_last_set_ms, group.last_sets], () => figuresOf(group));
  const width = Math.floor(recent.clientWidth);
  fill(recent, [width, group.sets, group.recent], () => (group.recent.length ? recentOf(group, width) : []));
  fill(inputs, group.inputs, () => [element("h3", {}, "Inputs"), element("div", {class: "cards"}, ...group.inputs.map((each) => input(group, each)))]);
}

function options(group) {
  const tolerance = group.tolerance ? [`${group.tolerance.key} ${duration(group.tolerance.ms)}`] : [];
  const waits = group.max_wait_ms === null ? [] : [`max_wait ${duration(group.max_wait_ms)}`];
  const bundle = group.bundle ? [`bundle ${group.bundle}`] : [];
  return [group.policy, ...tolerance, `queue_size ${group.queue_size}`, ...waits, ...bundle].join(", ");
}

function ofPossible(group) {
  return `${figure(group.rate_hz)} of ${figure(Math.max(group.possible_hz, group.rate_hz))}`;
}

function finding(each) {
  const level = each.severity === "ok" ? [] : [element("strong", {class: `level ${each.severity}`}, `${each.severity.toUpperCase()} `)];
  const fix = each.suggestion ? [element("p", {class: "fix"}, ...withCode(each.suggestion))] : [];
  return element("div", {class: `note ${each.severity}`}, element("p", {}, ...level, each.text), ...fix);
}

function withCode(text) {
  return text.split("`").map((part, at) => (at % 2 ? element("code", {}, part) : printable(part)));
}

function figuresOf(group) {
  const share = group.possible_hz ? Math.min(1, group.rate_hz / group.possible_hz) : 0;
  const last = group.since_last_set_ms === null ? "no set yet"
    : `${group.sets} ${group.sets === 1 ? "set" : "sets"}, last ${group.since_last_set_ms < 1500 ? "just now" : `${seconds(group.since_last_set_ms / 1000)} ago`}`;
  const meter = element("meter", {min: 0, max: 1, value: share, "aria-label": "share of the possible sets"});
  const line = element("p", {}, element("strong", {}, `${ofPossible(group)} `), "possible sets a second ", meter, ` ${last}`);
  if (!group.last_sets.length || !group.span_ms) return [line];
  const shifted = group.span_without_offsets_ms === null ? []
    : [element("p", {}, `without offsets, span p50 would be ${duration(group.span_without_offsets_ms)}`)];
  return [line, ...shifted, element("div", {class: "sparks"},
    sparkline("span", group.last_sets.map((each) => each.span_ms), group.span_ms),
    sparkline("latency", group.last_sets.map((each) => each.latency_ms), group.latency_ms))];
}

function recentOf(group, width) {
  const {picture, reasons, hasSets, shown} = lanes(group, width);
  return [element("h3", {}, `Recent ${hasSets ? "sets" : "messages"}: the last ${duration(shown)}, the newest on the right`), picture, legend(reasons, hasSets)];
}

function input(group, each) {
  const problem = group.findings.find((one) => one.topics.includes(each.topic) && one.severity !== "ok");
  const notes = [each.required ? [] : ["optional"], problem ? [problem.code.replaceAll("_", " ")] : []].flat();
  const rows = {
    rate: `${each.rate_hz ? `${figure(each.rate_hz)} Hz` : "–"}, lag ${duration(each.lag_ms)}, jitter ${duration(each.jitter_ms)}`,
    type: each.type ?? "not known yet",
    offset: each.offset_ms ? duration(each.offset_ms) : null,
    "sent in the last 10 s": sent(each),
    "dropped in the last 10 s": counts(each.unneeded_lately, each.other_drops_lately),
    "in total": `${each.received} received, ${each.matched} in sets, ${each.buffered} waiting, dropped: ${counts(each.unneeded, each.other_drops)}`,
    from: nodes(each.publishers) || "no publishers",
    to: `${each.output}: ${nodes(each.subscribers) || "no subscribers"}`,
  };
  const list = element("dl");
  for (const [name, value] of Object.entries(rows)) if (value !== null) list.append(element("dt", {}, name), element("dd", {}, value));
  return element("article", {class: "input"}, element("h4", {}, each.topic,
    ...notes.map((note) => element("span", {class: `level ${note === "optional" ? "" : problem.severity}`}, ` ${note}`))), list);
}

function counts(unneeded, others) {
  const reasons = Object.entries(others).sort(([, one], [, other]) => other - one).map(([reason, count]) => `${count} ${reason}`);
  return [...reasons, ...(unneeded ? [`${unneeded} not needed`] : [])].join(", ") || "none";
}

// What each publisher sent and what came of it; without numbers of messages, what DDS reports as lost.
function sent({senders, lost}) {
  if (!senders.length) return lost ? `${lost} lost on the way` : null;
  return senders.map((each) => {
    const rate = each.sent_hz ? ` at ${figure(each.sent_hz)} Hz` : "";
    return `${each.sent} by ${each.node}${rate}: ${each.delivered} delivered, ${each.lost} lost`;
  }).join("; ");
}

function nodes(endpoints) {
  const why = ({mismatch}) => (mismatch ? ` (${mismatch.policy}: ${mismatch.offered} offered, ${mismatch.requested} requested)` : "");
  return endpoints.map((each) => each.node + why(each)).join(", ");
}

function choose(name, isClicked) {
  const row = document.querySelector("#groups [aria-current=true]");
  closed = isClicked && !WIDE.matches && !closed && row?.firstChild.textContent === printable(name);
  chosen = name;
  history.replaceState(null, "", `#${encodeURIComponent(name.toWellFormed?.() ?? name)}`);
  show();
  // What was open above it and closed has moved the row away.
  if (isClicked && !WIDE.matches) document.querySelector("#groups [aria-current=true]").scrollIntoView({block: "nearest"});
}

function step(by) {
  const groups = state ? listed() : [];
  if (!groups.length) return;
  const at = Math.max(0, groups.findIndex((group) => group.name === chosen));
  const next = Math.min(groups.length - 1, Math.max(0, at + by));
  choose(groups[next].name, false);
  document.querySelector("#groups [aria-current=true]").focus();
}

function freeze() {
  frozen = !frozen;
  place("freeze").setAttribute("aria-pressed", String(frozen));
  place("freeze").textContent = frozen ? "Frozen: go on" : "Freeze";
}

function sort() {
  const names = Object.keys(ORDERS);
  order = names[(names.indexOf(order) + 1) % names.length];
  place("sort").textContent = `Order: ${order}`;
  show();
}

const KEYS = {j: () => step(1), ArrowDown: () => step(1), k: () => step(-1), ArrowUp: () => step(-1), " ": freeze, s: sort, "/": () => place("filter").focus()};

addEventListener("keydown", (event) => {
  const act = KEYS[event.key];
  // What is focused has the space for itself, and the arrows scroll where no group is chosen by them.
  if (event.target === place("filter")) {
    if (event.key === "Escape") { seek(""); place("filter").blur(); }
    return;
  }
  if (!act || event.ctrlKey || event.metaKey || event.altKey || (event.key === " " && event.target.closest(".controls, .names, a"))) return;
  if (event.key.startsWith("Arrow") && !event.target.closest("#groups")) return;
  event.preventDefault();
  act();
});
addEventListener("hashchange", () => { chosen = hashed(); show(); });
addEventListener("resize", () => show());
WIDE.addEventListener("change", () => show());
place("filter").addEventListener("input", (event) => seek(event.target.value));
place("freeze").addEventListener("click", freeze);
place("sort").addEventListener("click", sort);
ask();
