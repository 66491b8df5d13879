// Converts a frame's bytes to an object that a canvas can draw.

/** @typedef {import('./protocol.js').Picture} Picture */

/** @typedef {ImageBitmap | HTMLImageElement | HTMLCanvasElement} Drawable */

/**
 * @param {Picture} picture
 * @returns {Promise<Drawable>}
 */
export async function decode(picture) {
  const isJpeg = picture.encoding === 'jpeg';
  const bits = isJpeg ? new Blob([/** @type {Uint8Array<ArrayBuffer>} */ (picture.data)], { type: 'image/jpeg' }) : pixels(picture);
  if ('createImageBitmap' in globalThis) return createImageBitmap(bits);
  return bits instanceof Blob ? load(bits) : paint(bits);
}

// The fallback for Safari before version 15, which has no createImageBitmap.

/** @param {Blob} jpeg */
async function load(jpeg) {
  const image = new Image();
  image.src = URL.createObjectURL(jpeg);
  try {
    await image.decode();
  } finally {
    URL.revokeObjectURL(image.src);
  }
  return image;
}

/** @param {ImageData} pixels */
function paint(pixels) {
  const canvas = Object.assign(document.createElement('canvas'), { width: pixels.width, height: pixels.height });
  canvas.getContext('2d')?.putImageData(pixels, 0, 0);
  return canvas;
}

/** @param {Picture} picture */
function pixels(picture) {
  return new ImageData(picture.encoding === 'yuyv' ? yuyvToRgba(picture) : rgbToRgba(picture), picture.width, picture.height);
}

/** @param {Picture} picture */
export function rgbToRgba({ data, width, height }) {
  const rgba = new Uint8ClampedArray(width * height * 4).fill(255);
  for (let from = 0, to = 0; to < rgba.length; from += 3, to += 4) {
    rgba[to] = data[from];
    rgba[to + 1] = data[from + 1];
    rgba[to + 2] = data[from + 2];
  }
  return rgba;
}

/** Convert YUYV to RGBA by BT.601, the standard of USB cameras. @param {Picture} picture */
export function yuyvToRgba({ data, width, height }) {
  const rgba = new Uint8ClampedArray(width * height * 4).fill(255);
  for (let i = 0, to = 0; to < rgba.length; i += 2, to += 4) {
    const pair = i & ~3;
    const y = 1.164 * (data[i] - 16);
    const u = data[pair + 1] - 128;
    const v = data[pair + 3] - 128;
    rgba[to] = y + 1.596 * v;
    rgba[to + 1] = y - 0.392 * u - 0.813 * v;
    rgba[to + 2] = y + 2.017 * u;
  }
  return rgba;
}
