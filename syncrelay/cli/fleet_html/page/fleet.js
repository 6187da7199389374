"use strict";

// Shows the packed rows of each table, some at a time, and those alone that have all words of the filter.

const STEP = 50;
const SVG = "http://www.w3.org/2000/svg";

async function unpackRows(packed) {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return JSON.parse(await new Response(stream).text());
}

// What stands between backticks is code; everything is text, whatever a name says.
function coded(place, text) {
  text.split("`").forEach((part, at) => {
    if (!part) return;
    const piece = at % 2 ? document.createElement("code") : document.createTextNode(part);
    if (at % 2) piece.textContent = part;
    place.append(piece);
  });
}

function bar(percent) {
  const drawing = document.createElementNS(SVG, "svg");
  drawing.setAttribute("class", "share");
  drawing.setAttribute("viewBox", "0 0 100 10");
  drawing.setAttribute("preserveAspectRatio", "none");
  drawing.setAttribute("aria-hidden", "true");
  for (const [name, width] of [["ground", 100], ["", percent]]) {
    const part = document.createElementNS(SVG, "rect");
    part.setAttribute("class", name);
    part.setAttribute("width", width);
    part.setAttribute("height", 10);
    drawing.append(part);
  }
  return drawing;
}

class Table {
  constructor(section, rows) {
    this.section = section;
    this.rows = rows;
    this.texts = null;
    this.place = section.querySelector("tbody");
    ({bar: this.bar, short: this.short} = section.querySelector("table").dataset);
    this.input = section.querySelector("input");
    this.more = section.querySelector(".more");
    this.shown = STEP;
    this.input.addEventListener("input", () => { this.shown = STEP; this.draw(); });
    this.more.addEventListener("click", () => { this.shown += STEP; this.draw(); });
    section.querySelector(".controls").hidden = rows.length < 2;
    this.draw();
  }

  found() {
    const words = this.input.value.toLowerCase().split(/\s+/).filter(Boolean);
    if (!words.length) return this.rows;
    this.texts ??= this.rows.map(([, , ...cells]) => cells.join("\n").toLowerCase());
    return this.rows.filter((row, at) => words.every((word) => this.texts[at].includes(word)));
  }

  draw() {
    const found = this.found();
    this.place.replaceChildren(...found.slice(0, this.shown).map((row) => this.row(row)));
    this.more.hidden = found.length <= this.shown;
    this.more.textContent = `Show ${Math.min(STEP, found.length - this.shown)} more`;
    const shown = Math.min(this.shown, found.length);
    this.section.querySelector("output").value = `${shown} of ${found.length} shown`;
  }

  row([tone, percent, ...cells]) {
    const row = document.createElement("tr");
    cells.forEach((text, at) => {
      const cell = document.createElement(at ? "td" : "th");
      const length = [...text].length <= this.short ? "short" : "long";
      if (!at) {
        cell.scope = "row";
        cell.className = `${tone} ${length}`;
        cell.textContent = text;
      } else if (String(at) === this.bar) {
        cell.className = `rate ${tone}`;
        if (percent !== null) cell.append(bar(percent), " ");
      } else {
        cell.className = length;
      }
      // A name is no sentence of ours: backticks in it are its own.
      if (at) coded(cell, text);
      row.append(cell);
    });
    return row;
  }
}

async function start() {
  const rows = await unpackRows(JSON.parse(document.getElementById("rows").textContent));
  for (const section of document.querySelectorAll("section.ranked")) {
    if (section.querySelector("table")) new Table(section, rows[section.dataset.table]);
  }
  document.documentElement.dataset.drawn = "yes";
}

start();
