// Reads a message with the pictures of many robots; the counterpart of server/board/app.py. Pure.

import { parsePicture } from '../js/protocol.js';

const HEADER_BYTES = 6;

/**
 * @param {ArrayBuffer} message
 * @returns {Map<number, import('../js/protocol.js').Picture>} by the robots' numbers
 */
export function parsePictures(message) {
  const view = new DataView(message);
  const found = new Map();
  for (let at = 0; at + HEADER_BYTES <= message.byteLength; ) {
    const number = view.getUint16(at, true);
    const size = view.getUint32(at + 2, true);
    at += HEADER_BYTES;
    if (at + size > message.byteLength) break;
    found.set(number, parsePicture(message.slice(at, at + size)));
    at += size;
  }
  return found;
}
