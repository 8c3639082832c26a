// A WebM recording that says what it is: Matroska's COMMENT tag, put before the
// first cluster of what MediaRecorder wrote (RFC 9559), where readers look.

const ascii = (text) => new TextEncoder().encode(text);
const hex = (text) => Uint8Array.from(text.match(/../g), (b) => parseInt(b, 16));

function join(parts) {
  const out = new Uint8Array(parts.reduce((n, p) => n + p.length, 0));
  parts.reduce((at, p) => (out.set(p, at), at + p.length), 0);
  return out;
}

// An element: its id, the size in eight bytes, what it holds.
function element(id, ...children) {
  const data = join(children), size = new Uint8Array(8);
  new DataView(size.buffer).setBigUint64(0, (1n << 56n) | BigInt(data.length));
  return join([hex(id), size, data]);
}

// Where a byte pattern begins, or -1.
function find(bytes, pattern) {
  for (let i = 0; i + pattern.length <= bytes.length; i++)
    if (pattern.every((b, k) => bytes[i + k] === b)) return i;
  return -1;
}

// The recording with the comment; as it was where it has no cluster, or its
// segment a size of its own, which the tag would make wrong.
export function withComment(bytes, comment) {
  const segment = find(bytes, hex("18538067")), cluster = find(bytes, hex("1f43b675"));
  if (segment < 0 || cluster < 0 || find(bytes.subarray(segment + 4, segment + 12),
                                         hex("01ffffffffffffff")) !== 0) return bytes;
  const tags = element("1254c367", element("7373", element("63c0"), element("67c8",
    element("45a3", ascii("COMMENT")), element("4487", ascii(comment)))));
  return join([bytes.subarray(0, cluster), tags, bytes.subarray(cluster)]);
}
