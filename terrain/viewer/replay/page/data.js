// Arrays as terrain/viewer/replay/packing.py packs them: planes of bytes of differences, compressed by zlib, in base64.
const TYPES = {uint8: Uint8Array, uint16: Uint16Array, int16: Int16Array, int32: Int32Array, uint32: Uint32Array};

async function unpacked(entries, text) {
  const bytes = Uint8Array.from(atob(text), letter => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('deflate'));
  const raw = new Uint8Array(await new Response(stream).arrayBuffer());
  let at = 0;
  return entries.map(entry => {
    const values = summed(entry, raw, at);
    at += values.byteLength;
    return values;
  });
}

// Row after row of integers, from planes of bytes that begin at an offset.
function summed({type, columns, rows}, raw, at) {
  const count = columns * rows, differences = new TYPES[type](count), values = new TYPES[type](count);
  const bytes = new Uint8Array(differences.buffer), size = differences.BYTES_PER_ELEMENT;
  for (let plane = 0; plane < size; plane++)
    for (let k = 0; k < count; k++) bytes[k * size + plane] = raw[at + plane * count + k];
  for (let column = 0; column < columns; column++)
    for (let row = 0, sum = 0; row < rows; row++) {
      sum = (sum + differences[column * rows + row]) | 0;
      values[row * columns + column] = sum;
    }
  return values;
}

const fromMilli = values => Float32Array.from(values, value => value / 1000);

// Index of the last value that is not above a limit; -1 where all are.
function lastUpTo(values, limit) {
  let low = -1, high = values.length;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (values[middle] <= limit) low = middle; else high = middle;
  }
  return low;
}
