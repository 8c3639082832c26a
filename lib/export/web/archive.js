// The archive inside the page: base64, zlib, safetensors
// (formats/pagefile.h), and what lib/export/page.c packed into it.
import { unzlibSync } from "fflate";

const types = {
  U8: Uint8Array, I32: Int32Array, U16: Uint16Array, F32: Float32Array,
  F64: Float64Array,
};

export function bytesOf(base64) {
  if (Uint8Array.fromBase64) return Uint8Array.fromBase64(base64);
  const text = atob(base64);
  const bytes = new Uint8Array(text.length);
  for (let i = 0; i < bytes.length; i++) bytes[i] = text.charCodeAt(i);
  return bytes;
}

export const inflate = unzlibSync;

export class Archive {
  // of a page's text, of the file of spid-export --web, or of the engine's
  // {meta, arrays}
  constructor(text) {
    if (text.arrays) {
      Object.assign(this, { meta: text.meta, index: text.arrays });
      return;
    }
    const bytes = typeof text === "string" ? inflate(bytesOf(text))
                                           : new Uint8Array(text);
    const size = Number(new DataView(bytes.buffer, bytes.byteOffset)
      .getBigUint64(0, true));
    const json = new TextDecoder().decode(bytes.subarray(8, 8 + size));
    const { __metadata__, ...index } = JSON.parse(json);
    this.meta = __metadata__;
    this.index = index;
    const data = bytes.subarray(8 + size);
    if (Object.values(index).some(({ data_offsets: [, to] }) => to > data.length))
      throw new Error("cut short");
    for (const t of Object.values(index)) t.bytes = data.subarray(...t.data_offsets);
  }

  has(name) { return name in this.index; }

  shape(name) { return this.index[name].shape; }

  // A copy of an array as it is.
  array(name) {
    const { dtype, bytes } = this.index[name];
    return new types[dtype](bytes.slice().buffer);
  }

  // Rows of 16 bits between the ends of their range, as floats.
  planes(name) {
    const packed = this.array(name), range = this.array(`${name}.range`);
    const [rows, n] = this.shape(name);
    const out = new Float32Array(packed.length);
    for (let r = 0; r < rows; r++) {
      const lo = range[2 * r], step = (range[2 * r + 1] - lo) / 65534;
      for (let i = r * n; i < (r + 1) * n; i++) out[i] = lo + packed[i] * step;
    }
    return out;
  }

  // A picture of so many channels, from each pixel's difference to the one on
  // its left.
  picture(name, channels) {
    const out = this.array(name), [height, width] = this.shape(name);
    for (let y = 0; y < height; y++)
      for (let i = y * width + channels; i < (y + 1) * width; i++)
        out[i] = out[i] + out[i - channels] & 255;
    return out;
  }
}
