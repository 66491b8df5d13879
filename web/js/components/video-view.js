// <video-view>: shows the robot's picture, who drives, and what the robot would do.

import { append, fill, h, icon, say } from '../dom.js';
import { Painter } from '../painter.js';
import { ageParts, whoDrives } from '../advice.js';
import { percent, t } from '../i18n.js';
import { byPlace } from '../moves.js';
import { addressOf } from '../parts.js';
import { watchByRequests } from '../way.js';
import { makeNeedle, turnNeedle } from '../needle.js';

const OLD_PICTURE_MS = 200;
const FROZEN_MS = 1000;
const LIKE_MS = 500;
const TWO_LINES_PX = 55; // height of the text above the bars if it has two lines, for example while the robot asks for help
const SMALL_PX = 300;
const WORKER_MS = 3000; // a worker that has not started within this time is given up

export class VideoView extends HTMLElement {
  drawnMs = 0;
  frames = 0;
  likeMs = -LIKE_MS;

  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.canvas = h('canvas', { class: 'camera', width: 160, height: 120, role: 'img', 'aria-label': t('camera') });
    this.who = h('div', { class: 'who' });
    this.facts = h('div', { class: 'facts' });
    this.like = h('img', { width: 40, height: 30, alt: '' });
    this.likeLink = h('a', { class: 'like missing', href: addressOf('why'), 'aria-label': t('like_long') }, this.like, h('span', {}, t('like')));
    const { like, likeLink } = this;
    like.addEventListener('error', () => likeLink.classList.add('missing'));
    like.addEventListener('load', () => likeLink.classList.remove('missing'));
    this.votes = h('div', { class: 'votes', role: 'group', 'aria-label': t('would_do') });
    this.needle = makeNeedle();
    this.drawnMs = performance.now();
    append(this, [h('div', { class: 'picture' }, this.canvas, h('div', { class: 'corner' }, this.who, this.facts), this.likeLink, h('div', { class: 'low' }, this.needle, this.votes))]);
    const observer = new ResizeObserver(() => this.measure());
    observer.observe(this);
    observer.observe(this.who); // measure again when the height of `who` changes: the text size has changed
    const { store } = page;
    store.watch(['robot', 'link', 'held', 'moves'], (state) => this.render(state));
    store.watch(['isWatching'], ({ isWatching }) => this.watch(isWatching));
    this.ready = this.receive(this.canvas);
    setInterval(() => this.classList.toggle('frozen', performance.now() - this.drawnMs > FROZEN_MS), 500);
  }

  /** Let a worker draw the pictures if the browser supports it, otherwise the page. Resolves once it is decided who draws. @param {HTMLCanvasElement} canvas */
  async receive(canvas) {
    const { connection } = /** @type {import('../page.js').Page} */ (this.page);
    connection.addEventListener('shown', (event) => this.note(/** @type {CustomEvent} */ (event).detail));
    const worker = await startWorker();
    if (worker) {
      connection.useWorker(worker);
      const offscreen = canvas.transferControlToOffscreen();
      worker.postMessage({ canvas: offscreen, originMs: performance.timeOrigin }, [offscreen]);
      return;
    }
    const painter = new Painter(canvas, {
      nowMs: () => performance.now(),
      acknowledge: (frameId) => connection.acknowledge(frameId),
      shown: (shown) => connection.noteShown(shown),
    });
    connection.addEventListener('picture', (event) => painter.take(/** @type {CustomEvent} */ (event).detail));
  }

  /** Show pictures that are fetched by HTTP requests, instead of the video. @param {boolean} isWanted */
  watch(isWanted) {
    this.still?.remove();
    this.still = undefined;
    if (!isWanted) return;
    this.still = h('img', { class: 'still', alt: t('camera') });
    this.canvas?.after(this.still);
    watchByRequests(/** @type {HTMLImageElement} */ (this.still));
  }

  /** Called when a picture is on the screen. @param {import('../painter.js').Shown} shown */
  note(shown) {
    this.drawnMs = performance.now();
    this.page?.look(shown);
    if (!this.dataset.frames) performance.mark('first-frame');
    this.frames += 1;
    // Change the attribute rarely, because each change makes the browser render the whole page.
    if (this.frames === 1 || this.frames % 15 === 0) this.dataset.frames = String(this.frames);
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const robot = state.link === 'open' ? state.robot : null;
    this.dataset.by = robot?.driven_by ?? 'nobody';
    this.classList.toggle('away', !robot);
    this.renderWho(robot);
    if (this.who) this.who.hidden = state.link !== 'open'; // without a link, the page does not know who drives
    this.renderFacts(robot);
    this.renderVotes(robot?.prediction ?? null, state.moves);
    this.renderNeedle(robot, state.takesPoints);
    this.renderLike(robot);
  }

  /** Choose what fits into the picture: words, only symbols, or less (drive.css). What fits depends on the picture's width and on the language. */
  measure() {
    const votes = [...(this.votes?.children ?? [])];
    this.classList.toggle('many-votes', votes.length > 3);
    delete this.dataset.room;
    if (this.clientWidth <= SMALL_PX) this.dataset.room = 'small';
    const top = (/** @type {Element | undefined} */ part) => part?.getBoundingClientRect().top ?? 0;
    const fits = () => top(this.votes) - top(this.who) >= TWO_LINES_PX
      && votes.every((vote) => [vote, ...vote.children].every((part) => part.scrollWidth <= part.clientWidth));
    for (const room of ['narrow', 'narrower', 'small']) if (this.dataset.room !== 'small' && !fits()) this.dataset.room = room;
  }

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderWho(robot) {
    const by = robot?.driven_by ?? 'nobody';
    const who = whoDrives(robot);
    const text = t(`who.${who}`);
    if (!this.who || this.who.dataset.text === text) return;
    this.who.dataset.text = text;
    fill(this.who, icon(by), text);
  }

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderFacts(robot) {
    const facts = [];
    if (robot && robot.action !== 'stop') facts.push(t(`move.${robot.action}`));
    if (robot?.distance_m != null) facts.push(t('distance', { cm: Math.round(robot.distance_m * 100) }));
    if (robot?.game) facts.push(t(robot.game.is_over ? 'game_over' : 'game', { number: robot.game.number, score: Math.round(robot.game.score * 10) / 10 }));
    if (robot?.bumped) facts.push(t(whichBumper(robot.bumpers)));
    const state = this.page?.store.state;
    const ageMs = state?.pictureAgeMs;
    // Show the parts of the age only while pictures arrive: they explain why pictures are old, not why there are none.
    const parts = state && (state.drawnAgeMs ?? 0) > OLD_PICTURE_MS ? ageParts(state) : null;
    const total = parts ? Object.values(parts).reduce((sum, ms) => sum + ms) : Math.round((ageMs ?? 0) / 10) * 10;
    const isOld = (ageMs ?? 0) > OLD_PICTURE_MS;
    if (robot && isOld) facts.push(parts ? t(parts.brick === undefined ? 'age_parts' : 'age_parts_brick', { total, ...parts }) : t('picture_age', { ms: total }));
    const element = /** @type {HTMLElement} */ (this.facts);
    element.classList.toggle('old', isOld);
    element.hidden = facts.length === 0;
    say(element, facts.join(' · '));
  }

  /** @param {import('../protocol.js').Prediction | null} prediction @param {string[]} moves */
  renderVotes(prediction, moves) {
    const votes = /** @type {HTMLElement} */ (this.votes);
    if (votes.dataset.moves !== String(moves)) {
      votes.dataset.moves = String(moves);
      fill(votes, ...byPlace(moves).map(makeVote));
      this.measure();
    }
    for (const vote of /** @type {NodeListOf<HTMLElement>} */ (votes.querySelectorAll('.vote'))) {
      const move = vote.dataset.move ?? '';
      const share = prediction?.probabilities[move] ?? 0;
      const [bar, , figure] = /** @type {HTMLElement[]} */ ([...vote.children]);
      bar.style.transform = `scaleX(${share})`;
      say(figure, prediction?.action ? String(Math.round(share * 100)) : '–');
      vote.classList.toggle('best', prediction?.action === move);
      vote.setAttribute('aria-label', `${t(`move.${move}`)} ${percent(share)}`);
    }
  }

  /** @param {import('../protocol.js').RobotState | null} robot @param {boolean} takesPoints */
  renderNeedle(robot, takesPoints) {
    const needle = /** @type {HTMLElement} */ (this.needle);
    const driven = robot?.point?.steering ?? null;
    const proposed = robot?.prediction?.point?.steering ?? null;
    needle.hidden = !takesPoints || (driven === null && proposed === null);
    if (needle.hidden) return;
    const taught = robot?.driven_by === 'pilot' ? driven : null;
    turnNeedle(needle, { taught, proposed, spread: robot?.prediction?.spread ?? 0, driven });
  }

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderLike(robot) {
    const node = robot?.prediction?.node ?? null;
    const { like, likeLink } = this;
    if (!like || !likeLink) return;
    if (node === null) {
      likeLink.classList.add('missing');
      like.dataset.stamp = '';
    }
    // Load the image again from time to time, because merging changes an image but not its number.
    const stamp = node === null ? '' : /** @type {import('../page.js').Page} */ (this.page).imageOf(node, String(Math.floor((robot?.lessons ?? 0) / 20)));
    const nowMs = performance.now();
    // Each image is loaded and drawn again; twice a second is fast enough for a person.
    if (node === null || like.dataset.stamp === stamp || nowMs - this.likeMs < LIKE_MS) return;
    this.likeMs = nowMs;
    like.dataset.stamp = stamp;
    like.src = stamp;
  }
}

/** Start the worker that draws; null if the browser does not support it. @returns {Promise<Worker | null>} */
function startWorker() {
  if (!('transferControlToOffscreen' in HTMLCanvasElement.prototype)) return Promise.resolve(null);
  return new Promise((resolve) => {
    const worker = new Worker('js/video-worker.js', { type: 'module' });
    const giveUp = () => {
      worker.terminate();
      resolve(null);
    };
    const timer = setTimeout(giveUp, WORKER_MS);
    worker.onerror = giveUp;
    worker.onmessage = () => {
      clearTimeout(timer);
      worker.onerror = null;
      resolve(worker);
    };
  });
}

/** The text about the bumpers; it names the pressed bumper if the robot has two. @param {boolean[]} [bumpers] */
function whichBumper(bumpers) {
  const [left, right, ...more] = bumpers ?? [];
  if (right === undefined || more.length || left === right) return 'bumped';
  return left ? 'bumped.left' : 'bumped.right';
}

/** @param {string} move */
function makeVote(move) {
  return h('div', { class: 'vote', role: 'img', 'data-move': move },
    h('i'), h('b', {}, icon(move), h('span', {}, t(`move.${move}`))), h('span', {}, '–'));
}

customElements.define('video-view', VideoView);
