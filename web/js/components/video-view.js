// <video-view>: what the robot sees, who drives, what the robot would do, and what stands in the way.

import { append, fill, h, icon, say } from '../dom.js';
import { decode } from '../picture.js';
import { urgentAdvice } from '../advice.js';
import { percent, t } from '../i18n.js';
import { byPlace } from '../moves.js';
import { stepButton } from './toast-bar.js';

const OLD_PICTURE_MS = 200;
const FROZEN_MS = 1000;

export class VideoView extends HTMLElement {
  drawnMs = 0;

  /** @param {import('../page.js').Page} page */
  start(page) {
    this.page = page;
    this.canvas = h('canvas', { class: 'camera', width: 160, height: 120, role: 'img', 'aria-label': t('camera') });
    this.who = h('div', { class: 'who' });
    this.facts = h('div', { class: 'facts' });
    this.like = h('img', { width: 40, height: 30, alt: '' });
    this.likeLink = h('a', { class: 'like', href: '#gallery', hidden: true, 'aria-label': t('like_long') }, this.like, h('span', {}, t('like')));
    const { like, likeLink } = this;
    like.addEventListener('error', () => likeLink.classList.add('missing'));
    like.addEventListener('load', () => likeLink.classList.remove('missing'));
    this.notice = h('div', { class: 'notice', role: 'status', hidden: true });
    this.votes = h('div', { class: 'votes', role: 'group', 'aria-label': t('would_do') });
    this.drawnMs = performance.now();
    append(this, [h('div', { class: 'picture' }, this.canvas, h('div', { class: 'corner' }, this.who, this.facts), this.likeLink, this.votes), this.notice]);
    const { store } = page;
    store.watch(['robot', 'link', 'held', 'localStop', 'wheelAsked', 'wheelWaiting', 'notice', 'toast', 'hint', 'lesson', 'moves'], (state) => this.render(state));
    page.connection.addEventListener('picture', (event) =>
      this.show(/** @type {CustomEvent} */ (event).detail));
    setInterval(() => this.classList.toggle('frozen', performance.now() - this.drawnMs > FROZEN_MS), 500);
  }

  /** @param {import('../protocol.js').Picture} picture */
  async show(picture) {
    const { page, canvas } = this;
    const bitmap = await decode(picture).catch(() => null);
    // A broken picture is acknowledged as well, or the next would never come.
    if (!picture.quiet) page?.connection.acknowledge(picture.frameId);
    if (!bitmap || !canvas || !page) return;
    if (canvas.width !== bitmap.width) canvas.width = bitmap.width;
    if (canvas.height !== bitmap.height) canvas.height = bitmap.height;
    canvas.getContext('2d')?.drawImage(bitmap, 0, 0);
    bitmap.close();
    this.drawnMs = performance.now();
    page.looking = { frame: picture.frameId, capturedMs: picture.capturedMs };
    if (!this.dataset.frames) performance.mark('first-frame');
    this.dataset.frames = String(Number(this.dataset.frames ?? 0) + 1);
  }

  /** @param {import('../store.js').PageState} state */
  render(state) {
    const robot = state.link === 'open' ? state.robot : null;
    this.dataset.by = robot?.driven_by ?? 'nobody';
    this.classList.toggle('away', !robot);
    this.renderWho(robot);
    this.renderFacts(robot);
    this.renderVotes(robot?.prediction ?? null, state.moves);
    this.renderLike(robot);
    this.renderNotice(state);
  }

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderWho(robot) {
    const by = robot?.driven_by ?? 'nobody';
    const moving = robot && robot.action !== 'stop' ? ` · ${t(`move.${robot.action}`)}` : '';
    const who = by === 'nobody' && robot?.mode === 'train' ? t('who.waiting') : t(`who.${by}`);
    const text = who + moving;
    if (!this.who || this.who.dataset.text === text) return;
    this.who.dataset.text = text;
    fill(this.who, icon(by), text);
  }

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderFacts(robot) {
    const facts = [];
    if (robot?.distance_m != null) facts.push(t('distance', { cm: Math.round(robot.distance_m * 100) }));
    if (robot?.bumped) facts.push(t(whichBumper(robot.bumpers)));
    const ageMs = this.page?.store.state.pictureAgeMs;
    if (robot && ageMs != null) facts.push(t('picture_age', { ms: Math.max(1, Math.round(ageMs / 10)) * 10 }));
    const element = /** @type {HTMLElement} */ (this.facts);
    element.classList.toggle('old', (ageMs ?? 0) > OLD_PICTURE_MS);
    element.hidden = facts.length === 0;
    say(element, facts.join(' · '));
  }

  /** @param {import('../protocol.js').Prediction | null} prediction @param {string[]} moves */
  renderVotes(prediction, moves) {
    const votes = /** @type {HTMLElement} */ (this.votes);
    if (votes.dataset.moves !== String(moves)) {
      votes.dataset.moves = String(moves);
      fill(votes, ...byPlace(moves).map(makeVote));
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

  /** @param {import('../protocol.js').RobotState | null} robot */
  renderLike(robot) {
    const node = robot?.prediction?.node ?? null;
    const { like, likeLink } = this;
    if (!like || !likeLink) return;
    likeLink.hidden = node === null;
    // A merged image changes while it keeps its number: look again now and then.
    const stamp = `${node}/${Math.floor((robot?.lessons ?? 0) / 20)}`;
    if (node === null || like.dataset.stamp === stamp) return;
    like.dataset.stamp = stamp;
    like.src = `/api/gallery/${node}.png?v=${stamp.split('/')[1]}`;
  }

  /** @param {import('../store.js').PageState} state */
  renderNotice(state) {
    const notice = /** @type {HTMLElement} */ (this.notice);
    const urgent = urgentAdvice(state);
    // A toast goes before what is only good to know.
    const toast = urgent && urgent.level !== 'info' ? null : state.toast;
    const advice = toast ? null : urgent;
    const text = toast?.text ?? (advice ? t(advice.key, advice.values) : '');
    const stamp = `${text}/${advice?.step ?? toast?.step?.label ?? ''}`;
    notice.hidden = !text;
    this.classList.toggle('toasting', Boolean(toast));
    if (notice.dataset.stamp === stamp) return;
    notice.dataset.stamp = stamp;
    notice.dataset.level = advice?.level ?? '';
    const step = advice?.step;
    if (toast) fill(notice, h('p', {}, text), ...stepButton(/** @type {import('../page.js').Page} */ (this.page), toast));
    else fill(notice, h('p', {}, text),
      step ? h('button', { type: 'button', onclick: () => this.page?.take(step) }, t(`step.${step}`)) : null);
  }
}

/** The text for the bumpers: with two of them, which one. @param {boolean[]} [bumpers] */
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
