// Encodes pictures in a worker, so that the page stays responsive on a slow phone.

import { Packer } from './eye-picture.js';

const packer = new Packer((width, height) => new OffscreenCanvas(width, height));

addEventListener('message', async ({ data: { bitmap, to } }) => {
  const packed = await packer.pack(bitmap, bitmap.width, bitmap.height, to).catch(() => null);
  bitmap.close();
  /** @type {any} */ (globalThis).postMessage(packed, packed ? [packed.jpeg] : []);
});
