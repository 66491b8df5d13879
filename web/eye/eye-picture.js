// Converts a camera picture to a JPEG of the robot's size, in a worker if the browser supports it.

const QUALITY = 0.85;
const DARK = 20; // brightness from 0 to 255; if every pixel is darker, the lens is covered
const LOOK_EVERY = 5; // the lens is checked once in this number of pictures

export class Packer {
  /** @param {(width: number, height: number) => any} makeCanvas  an OffscreenCanvas or an element */
  constructor(makeCanvas) {
    this.canvas = makeCanvas(1, 1);
    this.paper = this.canvas.getContext('2d', { alpha: false });
    this.smallPaper = makeCanvas(16, 12).getContext('2d', { willReadFrequently: true });
    this.count = 0;
    this.covered = false;
  }

  /**
   * Crop the picture to the proportions that the robot wants, and encode it as JPEG.
   * @param {any} picture @param {number} fromWidth @param {number} fromHeight @param {{width: number, height: number}} to
   * @returns {Promise<{jpeg: ArrayBuffer, covered: boolean}>}
   */
  async pack(picture, fromWidth, fromHeight, { width, height }) {
    const { canvas, paper } = this;
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const scale = Math.min(fromWidth / width, fromHeight / height);
    const [w, h] = [width * scale, height * scale];
    paper.drawImage(picture, (fromWidth - w) / 2, (fromHeight - h) / 2, w, h, 0, 0, width, height);
    if (this.covered || this.count++ % LOOK_EVERY === 0) this.covered = this.isDark();
    const blob = canvas.convertToBlob
      ? await canvas.convertToBlob({ type: 'image/jpeg', quality: QUALITY })
      : await new Promise((done) => canvas.toBlob(done, 'image/jpeg', QUALITY));
    return { jpeg: await blob.arrayBuffer(), covered: this.covered };
  }

  isDark() {
    this.smallPaper.drawImage(this.canvas, 0, 0, 16, 12);
    const { data } = this.smallPaper.getImageData(0, 0, 16, 12);
    for (let i = 0; i < data.length; i += 4) if (Math.max(data[i], data[i + 1], data[i + 2]) > DARK) return false;
    return true;
  }
}
