// The recordings of past drives, as a part of the home screen.

import { ask, askLong } from '../api.js';
import { append, fill, h, icon } from '../dom.js';
import { count, language, t } from '../i18n.js';

/** @typedef {import('./home-screen.js').HomeScreen} Home */

/** @param {Home} home */
export async function listEpisodes(home) {
  const turn = (home.listing += 1);
  const answer = await home.attempt(() => askLong('api/episodes'));
  if (!answer) return;
  const seen = answer.episodes.filter((/** @type {any} */ episode) => episode.frames || answer.recording === episode.id);
  const list = await Promise.all(seen.map((/** @type {any} */ episode) => card(home, episode, answer.recording === episode.id)));
  const offered = answer.episodes.filter((/** @type {any} */ episode) => answer.offered.includes(episode.id));
  if (!home.isConnected || turn !== home.listing) return;
  const part = /** @type {HTMLElement} */ (home.episodes);
  fill(part, h('h2', {}, t('episodes')), answer.fault ? h('p', { class: 'hint' }, answer.fault) : null,
    offered.length ? h('p', { class: 'hint' }, t('episodes.full', { names: offered.map(title).join(', ') })) : null,
    trash(home, answer), home.offer, ...(list.length ? list : [h('p', { class: 'hint' }, t('episodes.none'))]));
  const ids = new Set(seen.map((/** @type {any} */ episode) => episode.id));
  for (const id of home.ticked) if (!ids.has(id)) home.ticked.delete(id);
  home.shelf = seen.map((/** @type {any} */ episode, /** @type {number} */ i) => ({ episode, card: list[i], isOn: answer.recording === episode.id }));
  find(home);
}

/** The space that deleted recordings still use, and the way to restore them. @param {Home} home @param {any} answer */
function trash(home, { trash_bytes: bytes, undo, days }) {
  if (!bytes) return null;
  const empty = () => home.page?.toast(t('trash.sure'), { label: t('trash.empty'), act: () => home.attempt(async () => {
    await ask('DELETE', 'api/trash');
    await listEpisodes(home);
  }) });
  return h('div', { class: 'row trash' }, h('p', { class: 'hint grow' }, t('trash', { size: size(bytes), days })),
    undo ? h('button', { type: 'button', onclick: () => restore(home, undo) }, t('trash.restore')) : null,
    h('button', { type: 'button', onclick: empty }, t('trash.free')));
}

/** Show only the recordings that contain every searched word. @param {Home} home */
function find(home) {
  const words = folded(home.finder.value).split(/\s+/);
  for (const one of home.shelf) {
    const about = folded([one.card.textContent, one.episode.id, one.episode.robot, one.episode.learner, one.episode.source, ...Object.keys(one.episode.taught)].join(' '));
    one.card.hidden = !words.every((word) => about.includes(word));
  }
  offer(home);
}

/** @param {string} text */
const folded = (text) => text.normalize('NFC').toLocaleLowerCase(language);

/** The recordings that are shown and can be ticked. @param {Home} home */
const shown = ({ shelf }) => shelf.filter(({ card, isOn }) => !isOn && !card.hidden);

/** Actions on several recordings (fetch, delete, teach): on those that are shown and ticked. @param {Home} home */
function offer(home) {
  const all = shown(home);
  const some = all.filter(({ episode }) => home.ticked.has(episode.id));
  const lessons = some.filter(({ episode }) => episode.lessons);
  const n = some.length;
  const tick = h('input', { type: 'checkbox', checked: n > 0 && n === all.length, onchange: () => tickAll(home, tick.checked) });
  tick.indeterminate = n > 0 && n < all.length;
  const bytes = (n ? some : all).reduce((sum, { episode }) => sum + episode.bytes, 0);
  home.finder.oninput = () => find(home);
  home.finder.hidden = home.shelf.length < 2;
  const words = home.shelf.length ? [h('label', { class: 'choice' }, tick, h('span', {}, t('episodes.all'))),
    h('small', { role: 'status' }, t(n ? 'episodes.ticked' : 'episodes.sum', { n: count(n || all.length), size: size(bytes) }))] : [];
  fill(home.chosen, ...words, ...(n ? [
    h('a', { class: 'button', href: zipOf(home, some.map(({ episode }) => episode.id)), download: '' }, t('episodes.zip', { n: count(n) })),
    h('button', { type: 'button', onclick: () => remove(home, some.map(({ episode }) => episode)) }, t('episodes.delete', { n: count(n) })),
    lessons.length ? h('button', { type: 'button', class: 'primary', onclick: () => teachTogether(home) }, t('again.together', { n: count(lessons.length) })) : null,
  ] : []));
}

/** The address of one file with these recordings; for all recordings no names are needed. @param {Home} home @param {string[]} ids */
function zipOf({ shelf }, ids) {
  return `api/episodes.zip${ids.length < shelf.length ? `?${new URLSearchParams(ids.map((id) => ['episode', id]))}` : ''}`;
}

/** @param {Home} home @param {boolean} isOn */
function tickAll(home, isOn) {
  for (const { episode, card } of shown(home)) {
    if (isOn) home.ticked.add(episode.id);
    else home.ticked.delete(episode.id);
    /** @type {HTMLInputElement} */ (card.querySelector('.tick input')).checked = isOn;
  }
  offer(home);
}

/** Teach again from the ticked recordings and from the open one. @param {Home} home @param {string[]} more */
async function teachTogether(home, ...more) {
  const { teachAgain } = await import('./teach-again.js');
  const ticked = shown(home).filter(({ episode }) => episode.lessons && home.ticked.has(episode.id));
  await teachAgain(home, [...new Set([...ticked.map(({ episode }) => episode.id), ...more])]);
}

/** @param {Home} home @param {any} episode @param {boolean} isOn */
async function card(home, episode, isOn) {
  const path = `api/episodes/${encodeURIComponent(episode.id)}`;
  const strip = h('div', { class: 'strip' });
  const tools = h('div', { class: 'stack' });
  const more = h('div', { class: 'stack' });
  const player = async () => (await import('./episode-player.js')).openPlayer(home, path, tools, () => teachTogether(home, episode.id));
  /** Open it once its content has loaded, so that no button moves afterwards. */
  const show = async (/** @type {boolean} */ isOpen) => {
    if (isOpen) {
      toggle.setAttribute('aria-busy', 'true');
      await home.attempt(() => Promise.all([strip.children.length ? null : showStrip(home, path, strip),
        isOn || tools.children.length ? null : player()]));
      toggle.removeAttribute('aria-busy');
    }
    more.hidden = !isOpen;
    toggle.setAttribute('aria-expanded', String(isOpen));
  };
  const toggle = h('button', {
    type: 'button', class: 'quiet', 'aria-label': t('home.more', { name: title(episode) }),
    onclick: () => {
      home.openEpisode = more.hidden ? episode.id : null;
      show(more.hidden);
    },
  }, icon('more'));
  append(more, [strip, tools, isOn ? null : naming(home, path, episode), h('div', { class: 'row' },
    h('a', { class: 'button', href: `${path}/file`, download: '' }, t('download')),
    isOn ? null : h('button', { type: 'button', 'aria-pressed': String(episode.protected), onclick: () => change(home, path, { protected: !episode.protected }) }, t('episodes.protect')),
    isOn || episode.protected ? null : h('button', { type: 'button', onclick: () => remove(home, [episode]) }, t('delete')))]);
  await show(home.openEpisode === episode.id);
  const tags = [isOn ? 'episodes.on' : '', episode.protected ? 'episodes.protected' : ''].filter(Boolean);
  const tick = h('input', {
    type: 'checkbox', checked: home.ticked.has(episode.id), 'aria-label': t('episodes.tick', { name: title(episode) }),
    onchange: () => {
      if (tick.checked) home.ticked.add(episode.id);
      else home.ticked.delete(episode.id);
      offer(home);
    },
  });
  return h('article', { class: 'panel stack', 'aria-label': title(episode) }, h('div', { class: 'facts-row' }, isOn ? null : h('label', { class: 'tick' }, tick),
    h('div', { class: 'grow' }, h('h3', {}, title(episode), ...tags.flatMap((key) => [' ', h('span', { class: 'tag' }, t(key))])),
      h('small', {}, facts(episode))), toggle), more);
}

/** @param {Home} home @param {string} path @param {any} episode */
function naming(home, path, episode) {
  const field = h('input', { value: episode.title, maxlength: 60, 'aria-label': t('episodes.title'), placeholder: t('episodes.title') });
  const save = (/** @type {Event} */ event) => {
    event.preventDefault();
    change(home, path, { title: field.value.trim() });
  };
  return h('form', { class: 'row', onsubmit: save }, field, h('button', {}, t('home.keep')));
}

/** @param {Home} home @param {string} path @param {{title?: string, protected?: boolean}} words */
async function change(home, path, words) {
  await home.attempt(() => ask('PATCH', path, words));
  await listEpisodes(home);
}

/** @param {any} episode */
function title(episode) {
  return episode.title || (!episode.started_at_s && episode.id) || new Date(episode.started_at_s * 1000).toLocaleString(language, { dateStyle: 'medium', timeStyle: 'medium' });
}

/** @param {number} bytes */
const size = (bytes) => `${(bytes / 1e6).toFixed(1)} MB`;

/** @param {any} episode */
function facts(episode) {
  const seconds = Math.round(episode.duration_s ?? 0);
  return [`${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, '0')}`,
    ...(episode.recording ? [] : [t('home.lessons', { n: episode.lessons ?? 0 })]), size(episode.bytes ?? 0)].join(' · ');
}

/** @param {Home} home @param {string} path @param {HTMLElement} strip */
async function showStrip(home, path, strip) {
  const answer = /** @type {any} */ (await home.attempt(() => askLong(`${path}/timeline?count=12`)));
  const frames = answer?.columns.frame ?? [];
  fill(strip, ...frames.map((/** @type {number} */ frame) => h('img', { alt: '', width: 40, height: 30, loading: 'lazy', src: `${path}/frames/${frame}` })));
}

/** @param {Home} home @param {any[]} episodes */
async function remove(home, episodes) {
  await home.attempt(async () => {
    const { undo, deleted, kept, days } = await ask('POST', 'api/episodes/delete', { episodes: episodes.map(({ id }) => id) });
    const what = deleted.length === 1 ? title(episodes.find(({ id }) => id === deleted[0])) : t('episodes.n', { n: count(deleted.length) });
    const whys = [...new Set(Object.values(kept))].join(' ');
    const sentences = [undo ? t('episodes.deleted', { what, days }) : '', whys ? t('episodes.kept', { n: count(Object.keys(kept).length), why: whys }) : ''];
    home.page?.toast(sentences.filter(Boolean).join(' '), undo ? { label: t('undo'), act: () => restore(home, undo) } : null);
    await listEpisodes(home);
  });
}

/** @param {Home} home @param {string} undo */
async function restore(home, undo) {
  await home.attempt(async () => {
    const { ids } = await ask('POST', 'api/episodes/restore', { undo });
    home.page?.toast(t('episodes.back', { n: count(ids.length) }));
    await listEpisodes(home);
  });
}
