// Corrections of a robot's wiring, of its straight driving, and of the side on which its camera stands.

import { ask } from '../api.js';
import { group } from '../components/settings-screen.js';
import { h, say } from '../dom.js';
import { percent, t } from '../i18n.js';

/** @typedef {{reverse: string, swap_sides: boolean, trim: number, turn_picture: number, mirror_picture: boolean, possible: string[]}} Corrections */
/** @typedef {(change: object) => Promise<any>} Correct  applies a correction; the robot stops first */

/** @param {import('../components/settings-screen.js').SettingsScreen} screen @returns {Promise<HTMLElement | null>} null for a robot that needs none */
export async function showCorrections(screen) {
  const now = /** @type {Corrections} */ (await ask('GET', 'api/corrections').catch(() => ({ possible: [] })));
  /** @type {Correct} */
  const correct = async (change) => {
    const done = await screen.put('api/corrections', change);
    if (!done) await screen.refresh();
    return done;
  };
  const groups = [picture(now, correct, screen), body(now, correct)].filter((one) => one !== null);
  return groups.length ? h('div', { class: 'stack' }, ...groups) : null;
}

/** The camera's picture with buttons to turn it upright. @param {Corrections} now @param {Correct} correct @param {import('../components/settings-screen.js').SettingsScreen} screen */
function picture({ turn_picture: turn, mirror_picture: isMirrored, possible }, correct, screen) {
  if (!possible.includes('turn_picture')) return null;
  const seen = h('img', { class: 'seen', alt: t('settings.camera') });
  let looks = 0;
  /** Show the stream from its start, while it is visible. It is started again because a browser may keep the first picture's size. */
  const look = () => seen.setAttribute('src', `video.mjpg?${(looks += 1)}`);
  const inView = new IntersectionObserver(([{ isIntersecting }]) => (isIntersecting ? look() : seen.removeAttribute('src')));
  inView.observe(seen);
  screen.endings?.push(() => {
    inView.disconnect();
    seen.removeAttribute('src'); // otherwise the stream continues
  });
  let turned = turn;
  const turnOn = async () => {
    turned = (turned + 90) % 360;
    if (await correct({ turn_picture: turned }) && seen.hasAttribute('src')) look();
  };
  const mirror = h('input', { type: 'checkbox', checked: isMirrored, onchange: () => correct({ mirror_picture: mirror.checked }) });
  return group(t('settings.picture'), t('settings.turn_hint'), seen,
    h('button', { type: 'button', onclick: turnOn }, t('settings.turn')),
    h('label', { class: 'choice' }, mirror, h('span', {}, t('settings.mirrored'))));
}

/** @param {Corrections} now @param {Correct} correct */
function body({ reverse, swap_sides: isSwapped, trim, possible }, correct) {
  if (!['reverse', 'swap_sides', 'trim'].some((name) => possible.includes(name))) return null;
  const told = (/** @type {number} */ value) => `${value ? t(value < 0 ? 'move.left' : 'move.right') : ''} ${percent(Math.abs(value))}`;
  const shown = h('output', {}, told(trim));
  const slider = h('input', {
    type: 'range', min: -30, max: 30, step: 1, value: Math.round(trim * 100), 'aria-label': t('settings.trim'),
    oninput: () => say(shown, told(Number(slider.value) / 100)),
    onchange: () => correct({ trim: Number(slider.value) / 100 }),
  });
  const swapped = h('input', { type: 'checkbox', checked: isSwapped, onchange: () => correct({ swap_sides: swapped.checked }) });
  const reversed = h('select', { 'aria-label': t('settings.reverse'), onchange: () => correct({ reverse: reversed.value }) },
    ...Object.entries({ none: '–', left: t('move.left'), right: t('move.right'), both: `${t('move.left')} + ${t('move.right')}` })
      .map(([side, label]) => h('option', { value: side, selected: side === reverse }, label)));
  return group(t('settings.body'), t('settings.body_hint'),
    possible.includes('trim') ? h('label', {}, t('settings.trim'), h('div', { class: 'slider' }, slider, shown)) : null,
    possible.includes('swap_sides') ? h('label', { class: 'choice' }, swapped, h('span', {}, t('settings.swapped'))) : null,
    possible.includes('reverse') ? h('label', {}, t('settings.reverse'), ' ', reversed) : null);
}
