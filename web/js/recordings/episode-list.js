// The recordings of past drives, as a part of the recordings screen.

import { ask, askLong } from '../api.js';
import { append, fill, h, icon } from '../dom.js';
import { count, language, t } from '../i18n.js';

/** @typedef {import('./recordings.js').Recordings} Recordings */

/** @param {Recordings} recordings */
export async function listEpisodes(recordings) {
  const turn = (recordings.listing += 1);
  const answer = await recordings.attempt(() => askLong('api/episodes'));
  if (!answer) return;
  const seen = answer.episodes.filter((/** @type {any} */ episode) => episode.frames || answer.recording === episode.id);
  const list = await Promise.all(seen.map((/** @type {any} */ episode) => card(recordings, episode, answer.recording === episode.id)));
  const offered = answer.episodes.filter((/** @type {any} */ episode) => answer.offered.includes(episode.id));
  if (!recordings.isConnected || turn !== recordings.listing) return;
  const part = /** @type {HTMLElement} */ (recordings.episodes);
  fill(part, h('h2', {}, t('episodes')), answer.fault ? h('p', { class: 'hint' }, answer.fault) : null,
    offered.length ? h('p', { class: 'hint' }, t('episodes.full', { names: offered.map(title).join(', ') })) : null,
    trash(recordings, answer), recordings.offer, ...(list.length ? list : [h('p', { class: 'hint' }, t('episodes.none'))]));
  const ids = new Set(seen.map((/** @type {any} */ episode) => episode.id));
  for (const id of recordings.ticked) if (!ids.has(id)) recordings.ticked.delete(id);
  recordings.shelf = seen.map((/** @type {any} */ episode, /** @type {number} */ i) => ({ episode, card: list[i], isOn: answer.recording === episode.id }));
  find(recordings);
}

/** Shows the space that deleted recordings still use, with buttons to restore them and to empty the trash. @param {Recordings} recordings @param {any} answer */
function trash(recordings, { trash_bytes: bytes, undo, days }) {
  if (!bytes) return null;
  const empty = () => recordings.page?.toast(t('trash.sure'), { label: t('trash.empty'), act: () => recordings.attempt(async () => {
    await ask('DELETE', 'api/trash');
    await listEpisodes(recordings);
  }) });
  return h('div', { class: 'row trash' }, h('p', { class: 'hint grow' }, t('trash', { size: size(bytes), days })),
    undo ? h('button', { type: 'button', onclick: () => restore(recordings, undo) }, t('trash.restore')) : null,
    h('button', { type: 'button', onclick: empty }, t('trash.free')));
}

/** Show only the recordings that contain every searched word. @param {Recordings} recordings */
function find(recordings) {
  const words = folded(recordings.finder.value).split(/\s+/);
  for (const one of recordings.shelf) {
    const about = folded([one.card.textContent, one.episode.id, one.episode.robot, one.episode.learner, one.episode.source, ...Object.keys(one.episode.taught)].join(' '));
    one.card.hidden = !words.every((word) => about.includes(word));
  }
  offer(recordings);
}

/** @param {string} text */
const folded = (text) => text.normalize('NFC').toLocaleLowerCase(language);

/** Return the recordings that are shown and can be ticked. @param {Recordings} recordings */
const shown = ({ shelf }) => shelf.filter(({ card, isOn }) => !isOn && !card.hidden);

/** Buttons that download, delete or teach from all recordings that are shown and ticked. @param {Recordings} recordings */
function offer(recordings) {
  const all = shown(recordings);
  const some = all.filter(({ episode }) => recordings.ticked.has(episode.id));
  const lessons = some.filter(({ episode }) => episode.lessons);
  const n = some.length;
  const tick = h('input', { type: 'checkbox', checked: n > 0 && n === all.length, onchange: () => tickAll(recordings, tick.checked) });
  tick.indeterminate = n > 0 && n < all.length;
  const bytes = (n ? some : all).reduce((sum, { episode }) => sum + episode.bytes, 0);
  recordings.finder.oninput = () => find(recordings);
  recordings.finder.hidden = recordings.shelf.length < 2;
  const words = recordings.shelf.length ? [h('label', { class: 'choice' }, tick, h('span', {}, t('episodes.all'))),
    h('small', { role: 'status' }, t(n ? 'episodes.ticked' : 'episodes.sum', { n: count(n || all.length), size: size(bytes) }))] : [];
  fill(recordings.chosen, ...words, ...(n ? [
    h('a', { class: 'button', href: zipOf(recordings, some.map(({ episode }) => episode.id)), download: '' }, t('episodes.zip', { n: count(n) })),
    h('button', { type: 'button', onclick: () => remove(recordings, some.map(({ episode }) => episode)) }, t('episodes.delete', { n: count(n) })),
    lessons.length ? h('button', { type: 'button', class: 'primary', onclick: () => teachTogether(recordings) }, t('again.together', { n: count(lessons.length) })) : null,
  ] : []));
}

/** Return the address of a zip file with these recordings; the address of all recordings has no names. @param {Recordings} recordings @param {string[]} ids */
function zipOf({ shelf }, ids) {
  return `api/episodes.zip${ids.length < shelf.length ? `?${new URLSearchParams(ids.map((id) => ['episode', id]))}` : ''}`;
}

/** @param {Recordings} recordings @param {boolean} isOn */
function tickAll(recordings, isOn) {
  for (const { episode, card } of shown(recordings)) {
    if (isOn) recordings.ticked.add(episode.id);
    else recordings.ticked.delete(episode.id);
    /** @type {HTMLInputElement} */ (card.querySelector('.tick input')).checked = isOn;
  }
  offer(recordings);
}

/** Teach again from the ticked recordings and from the open one. @param {Recordings} recordings @param {string[]} more */
async function teachTogether(recordings, ...more) {
  const { teachAgain } = await import('./teach-again.js');
  const ticked = shown(recordings).filter(({ episode }) => episode.lessons && recordings.ticked.has(episode.id));
  await teachAgain(recordings, [...new Set([...ticked.map(({ episode }) => episode.id), ...more])]);
}

/** @param {Recordings} recordings @param {any} episode @param {boolean} isOn */
async function card(recordings, episode, isOn) {
  const path = `api/episodes/${encodeURIComponent(episode.id)}`;
  const strip = h('div', { class: 'strip' });
  const tools = h('div', { class: 'stack' });
  const more = h('div', { class: 'stack' });
  const player = async () => (await import('./episode-player.js')).openPlayer(recordings, path, tools, () => teachTogether(recordings, episode.id));
  /** Open the recording once its content has loaded, so that no button moves afterwards. */
  const show = async (/** @type {boolean} */ isOpen) => {
    if (isOpen) {
      toggle.setAttribute('aria-busy', 'true');
      await recordings.attempt(() => Promise.all([strip.children.length ? null : showStrip(recordings, path, strip),
        isOn || tools.children.length ? null : player()]));
      toggle.removeAttribute('aria-busy');
    }
    more.hidden = !isOpen;
    toggle.setAttribute('aria-expanded', String(isOpen));
  };
  const toggle = h('button', {
    type: 'button', class: 'quiet', 'aria-label': t('home.more', { name: title(episode) }),
    onclick: () => {
      recordings.openEpisode = more.hidden ? episode.id : null;
      show(more.hidden);
    },
  }, icon('more'));
  append(more, [strip, tools, isOn ? null : naming(recordings, path, episode), h('div', { class: 'row' },
    h('a', { class: 'button', href: `${path}/file`, download: '' }, t('download')),
    isOn ? null : h('button', { type: 'button', 'aria-pressed': String(episode.protected), onclick: () => change(recordings, path, { protected: !episode.protected }) }, t('episodes.protect')),
    isOn || episode.protected ? null : h('button', { type: 'button', onclick: () => remove(recordings, [episode]) }, t('delete')))]);
  await show(recordings.openEpisode === episode.id);
  const tags = [isOn ? 'episodes.on' : '', episode.protected ? 'episodes.protected' : ''].filter(Boolean);
  const tick = h('input', {
    type: 'checkbox', checked: recordings.ticked.has(episode.id), 'aria-label': t('episodes.tick', { name: title(episode) }),
    onchange: () => {
      if (tick.checked) recordings.ticked.add(episode.id);
      else recordings.ticked.delete(episode.id);
      offer(recordings);
    },
  });
  return h('article', { class: 'panel stack', 'aria-label': title(episode) }, h('div', { class: 'facts-row' }, isOn ? null : h('label', { class: 'tick' }, tick),
    h('div', { class: 'grow' }, h('h3', {}, title(episode), ...tags.flatMap((key) => [' ', h('span', { class: 'tag' }, t(key))])),
      h('small', {}, facts(episode))), toggle), more);
}

/** @param {Recordings} recordings @param {string} path @param {any} episode */
function naming(recordings, path, episode) {
  const field = h('input', { value: episode.title, maxlength: 60, 'aria-label': t('episodes.title'), placeholder: t('episodes.title') });
  const save = (/** @type {Event} */ event) => {
    event.preventDefault();
    change(recordings, path, { title: field.value.trim() });
  };
  return h('form', { class: 'row', onsubmit: save }, field, h('button', {}, t('home.keep')));
}

/** @param {Recordings} recordings @param {string} path @param {{title?: string, protected?: boolean}} words */
async function change(recordings, path, words) {
  await recordings.attempt(() => ask('PATCH', path, words));
  await listEpisodes(recordings);
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

/** @param {Recordings} recordings @param {string} path @param {HTMLElement} strip */
async function showStrip(recordings, path, strip) {
  const answer = /** @type {any} */ (await recordings.attempt(() => askLong(`${path}/timeline?count=12`)));
  const frames = answer?.columns.frame ?? [];
  fill(strip, ...frames.map((/** @type {number} */ frame) => h('img', { alt: '', width: 40, height: 30, loading: 'lazy', src: `${path}/frames/${frame}` })));
}

/** @param {Recordings} recordings @param {any[]} episodes */
async function remove(recordings, episodes) {
  await recordings.attempt(async () => {
    const { undo, deleted, kept, days } = await ask('POST', 'api/episodes/delete', { episodes: episodes.map(({ id }) => id) });
    const what = deleted.length === 1 ? title(episodes.find(({ id }) => id === deleted[0])) : t('episodes.n', { n: count(deleted.length) });
    const whys = [...new Set(Object.values(kept))].join(' ');
    const sentences = [undo ? t('episodes.deleted', { what, days }) : '', whys ? t('episodes.kept', { n: count(Object.keys(kept).length), why: whys }) : ''];
    recordings.page?.toast(sentences.filter(Boolean).join(' '), undo ? { label: t('undo'), act: () => restore(recordings, undo) } : null);
    await listEpisodes(recordings);
  });
}

/** @param {Recordings} recordings @param {string} undo */
async function restore(recordings, undo) {
  await recordings.attempt(async () => {
    const { ids } = await ask('POST', 'api/episodes/restore', { undo });
    recordings.page?.toast(t('episodes.back', { n: count(ids.length) }));
    await listEpisodes(recordings);
  });
}
