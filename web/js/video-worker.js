// Receives, decodes, draws and acknowledges the pictures in a worker.
// The page's main thread therefore has time for touches and for the heartbeat.
//
// The page posts `{canvas, originMs}` once, and then `{open: url}` or `{close: true}`.
// The page receives `'ready'`, `{shown}` for each drawn picture, and `{closed: true}` when the socket ends.

import { Painter } from './painter.js';
import { encodeAcknowledgement, parsePicture } from './protocol.js';

const page = /** @type {any} */ (self);
/** @type {WebSocket | null} */
let socket = null;
/** @type {Painter | null} */
let painter = null;
let aheadMs = 0; // by how much this thread's clock is ahead of the page's clock

page.onmessage = (/** @type {MessageEvent} */ { data }) => {
  if (data.canvas) {
    aheadMs = performance.timeOrigin - data.originMs;
    painter = new Painter(data.canvas, {
      nowMs: () => performance.now() + aheadMs,
      shown: (shown) => page.postMessage({ shown }),
      acknowledge: (frameId) => socket?.readyState === 1 && socket.send(encodeAcknowledgement(frameId)),
    });
  }
  if (data.open || data.close) drop();
  if (data.open) open(data.open);
};

/** @param {string} url */
function open(url) {
  socket = new WebSocket(url);
  socket.binaryType = 'arraybuffer';
  socket.onmessage = ({ data }) => painter?.take(parsePicture(data));
  socket.onclose = () => page.postMessage({ closed: true });
}

function drop() {
  if (!socket) return;
  socket.onmessage = socket.onclose = null;
  socket.close();
  socket = null;
}

page.postMessage('ready');
