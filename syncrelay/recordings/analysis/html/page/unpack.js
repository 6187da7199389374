"use strict";

// The other side of packing.py: steps between whole numbers, lowest bytes first, gzip, base64.
async function unpack({count, unit, steps}) {
  const packed = Uint8Array.from(atob(steps), (letter) => letter.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const values = new Float64Array(count);
  let value = 0;
  for (let at = 0; at < count; at++) {
    value += bytes[at] | (bytes[count + at] << 8) | (bytes[2 * count + at] << 16) | (bytes[3 * count + at] << 24);
    values[at] = value * unit;
  }
  return values;
}

async function unpackTimeline(timeline) {
  const lanes = await Promise.all(timeline.lanes.map(async ({topic, times, fates}) => (
    {topic, times: await unpack(times), fates: await unpack(fates)}
  )));
  const members = await Promise.all(timeline.members.map(unpack));
  const [spans, latencies] = await Promise.all([timeline.spans, timeline.latencies].map(unpack));
  const begins = new Float64Array(timeline.spans.count).fill(Infinity);
  members.forEach((places, lane) => places.forEach((place, set) => {
    if (place >= 0) begins[set] = Math.min(begins[set], lanes[lane].times[place]);
  }));
  return {...timeline, lanes, members, begins, spans, latencies};
}
