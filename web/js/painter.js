// Draws the newest picture on a canvas.
// A picture that arrives during drawing replaces the waiting one, so a slow phone skips pictures and no queue grows.
//
// Used in a worker with a transferred canvas, or on the page if there is no worker.

import { decode } from './picture.js';

/** @typedef {import('./protocol.js').Picture} Picture */
/** @typedef {{frame: number, capturedMs: number, arrivedMs: number, nonce: number}} Shown  a picture on the screen */

export class Painter {
  /**
   * @param {HTMLCanvasElement | OffscreenCanvas} canvas
   * @param {{acknowledge: (frameId: number) => void, shown: (shown: Shown) => void, nowMs: () => number,
   *   decode?: (picture: Picture) => Promise<import('./picture.js').Drawable>}} around
   */
  constructor(canvas, around) {
    this.canvas = canvas;
    this.around = { decode, ...around };
    /** @type {{picture: Picture, arrivedMs: number} | null} */
    this.waiting = null;
    /** @type {any} */
    this.context = null;
    this.isDrawing = false;
    this.owesAnswer = false;
    this.dropped = 0;
  }

  /** Take a picture that has just arrived. @param {Picture} picture */
  take(picture) {
    // A picture that is dropped is not acknowledged, because the acknowledgement of a later one covers it.
    this.owesAnswer ||= !picture.quiet;
    if (this.waiting) this.dropped += 1;
    this.waiting = { picture, arrivedMs: this.around.nowMs() };
    if (!this.isDrawing) this.drawAll();
  }

  async drawAll() {
    this.isDrawing = true;
    while (this.waiting) {
      const { picture, arrivedMs } = this.waiting;
      const owesAnswer = this.owesAnswer;
      this.waiting = null;
      this.owesAnswer = false;
      const bitmap = await this.around.decode(picture).catch(() => null);
      if (bitmap) this.draw(bitmap);
      // Acknowledge a broken picture, too, because otherwise the next picture would never come.
      if (owesAnswer) this.around.acknowledge(picture.frameId);
      if (bitmap) this.around.shown({ frame: picture.frameId, capturedMs: picture.capturedMs, arrivedMs, nonce: picture.nonce ?? 0 });
    }
    this.isDrawing = false;
  }

  /** @param {import('./picture.js').Drawable} bitmap */
  draw(bitmap) {
    const { canvas } = this;
    if (canvas.width !== bitmap.width) canvas.width = bitmap.width;
    if (canvas.height !== bitmap.height) canvas.height = bitmap.height;
    // Request the context only once, because Firefox returns the context of a transferred canvas only once.
    this.context ??= canvas.getContext('2d');
    this.context?.drawImage(bitmap, 0, 0);
    if ('close' in bitmap) bitmap.close();
  }
}
