// What Python has packed: arrays are bytes sorted by significance, whole numbers differences along the rows.

const TYPES = { f4: Float32Array, i8: BigInt64Array, i4: Int32Array, i2: Int16Array };

async function unpacked() {
  const packed = Uint8Array.from(atob(document.getElementById("data").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const size = new DataView(bytes.buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + size)));
  const arrays = bytes.subarray(4 + size), { frames, ...rest } = head;
  // Frames are unpacked when they are shown: all together they may need more memory than there is.
  return { ...withArrays(rest, arrays), frames, read: (packed) => arrayOf(packed, arrays) };
}

function withArrays(value, bytes) {
  if (Array.isArray(value)) return value.map((item) => withArrays(item, bytes));
  if (value === null || typeof value !== "object") return value;
  if (value.type in TYPES) return arrayOf(value, bytes);
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, withArrays(item, bytes)]));
}

function arrayOf({ type, start, count, width, step }, bytes) {
  const each = TYPES[type].BYTES_PER_ELEMENT, sorted = new Uint8Array(count * each);
  for (let b = 0; b < each; b++)
    for (let i = 0; i < count; i++) sorted[i * each + b] = bytes[start + b * count + i];
  const array = new TYPES[type](sorted.buffer);
  if (type !== "f4") for (let i = width; i < count; i++) array[i] += array[i - width];
  return step === undefined ? array : Float32Array.from(array, (whole) => whole * step);
}
