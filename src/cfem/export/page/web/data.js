// The text that data.py packed: decoded, its length and checksum compared. Throws a sentence where it is damaged.
const CUT = "The data in this page are incomplete or damaged, so nothing is drawn. Ask for the file again, or export it again.";

function bytesOf(text) {
  let raw;
  try { raw = atob(text.trim()); } catch { throw new Error(CUT); }
  const bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return bytes;
}

async function inflate(bytes) {
  if (typeof DecompressionStream === "undefined") throw new Error("This browser is too old for this page: it cannot decompress data. Any browser of 2023 or later can.");
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  try { return new Uint8Array(await new Response(stream).arrayBuffer()); } catch { throw new Error(CUT); }
}

function crc32(bytes) {
  const table = new Uint32Array(256);
  for (let n = 0; n < 256; n++) {
    let c = n;
    for (let k = 0; k < 8; k++) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
    table[n] = c;
  }
  let c = ~0;
  for (const byte of bytes) c = table[(c ^ byte) & 255] ^ (c >>> 8);
  return ~c >>> 0;
}

async function unpack(element) {
  if (!element) throw new Error(CUT);
  const whole = await inflate(bytesOf(element.textContent));
  if (whole.length !== Number(element.dataset.bytes) || crc32(whole) !== Number(element.dataset.crc)) throw new Error(CUT);
  const view = new DataView(whole.buffer), length = view.getUint32(8, true);
  const said = JSON.parse(new TextDecoder().decode(whole.subarray(16, 16 + length)));
  const arrays = {};
  let at = 16 + length;
  for (const [name, one] of Object.entries(said.arrays)) {
    const part = whole.slice(at, at + one.bytes);
    at += one.bytes + (8 - one.bytes % 8) % 8;
    arrays[name] = one.type === "bytes" ? part : one.type === "double" ? new Float64Array(part.buffer) : fromPlanes(part);
    if (one.type === "single") arrays[name] = Float64Array.from(new Float32Array(arrays[name].buffer));
    if (one.type !== "fixed") continue;
    const count = arrays[name].length / one.steps.length;
    arrays[name] = Float64Array.from(arrays[name], (value, i) => value * one.steps[Math.floor(i / count)]);
  }
  return { said, arrays };
}

function fromPlanes(planes) {
  const count = planes.length / 4, whole = new Int32Array(count);
  for (let i = 0; i < count; i++) whole[i] = planes[i] | planes[count + i] << 8 | planes[2 * count + i] << 16 | planes[3 * count + i] << 24;
  return whole;
}
