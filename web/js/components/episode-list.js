// The recordings of past drives, as a part of the home screen.

import { ask, askLong } from '../api.js';
import { append, fill, h, icon } from '../dom.js';
import { language, t } from '../i18n.js';

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
    home.offer, ...(list.length ? list : [h('p', { class: 'hint' }, t('episodes.none'))]));
  const ids = new Set(seen.map((/** @type {any} */ episode) => episode.id));
  for (const id of home.ticked) if (!ids.has(id)) home.ticked.delete(id);
  offer(home);
}

/** Several recordings can be taught together. @param {Home} home */
function offer(home) {
  const place = /** @type {HTMLElement} */ (home.offer);
  const n = home.ticked.size;
  fill(place, n ? h('button', { type: 'button', class: 'primary', onclick: () => teachTogether(home) }, t('again.together', { n })) : null);
}

/** Teach again from what is ticked, and from the one that is open. @param {Home} home @param {string[]} more */
async function teachTogether(home, ...more) {
  const { teachAgain } = await import('./teach-again.js');
  await teachAgain(home, [...new Set([...home.ticked, ...more])]);
}

/** @param {Home} home @param {any} episode @param {boolean} isOn */
async function card(home, episode, isOn) {
  const path = `api/episodes/${encodeURIComponent(episode.id)}`;
  const strip = h('div', { class: 'strip' });
  const tools = h('div', { class: 'stack' });
  const more = h('div', { class: 'stack' });
  const player = async () => (await import('./episode-player.js')).openPlayer(home, path, tools, () => teachTogether(home, episode.id));
  /** Open it once all that it shows is there, so that no button in it moves afterwards. */
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
    isOn || episode.protected ? null : h('button', { type: 'button', onclick: () => remove(home, path, title(episode)) }, t('delete')))]);
  await show(home.openEpisode === episode.id);
  const tags = [isOn ? 'episodes.on' : '', episode.protected ? 'episodes.protected' : ''].filter(Boolean);
  const tick = h('input', {
    type: 'checkbox', checked: home.ticked.has(episode.id), 'aria-label': t('again.tick', { name: title(episode) }),
    onchange: () => {
      if (tick.checked) home.ticked.add(episode.id);
      else home.ticked.delete(episode.id);
      offer(home);
    },
  });
  return h('article', { class: 'panel stack', 'aria-label': title(episode) }, h('div', { class: 'facts-row' }, isOn || !episode.lessons ? null : h('label', { class: 'tick' }, tick),
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

/** @param {any} episode */
function facts(episode) {
  const seconds = Math.round(episode.duration_s ?? 0);
  return [`${Math.floor(seconds / 60)}:${String(seconds % 60).padStart(2, '0')}`,
    ...(episode.recording ? [] : [t('home.lessons', { n: episode.lessons ?? 0 })]), `${((episode.bytes ?? 0) / 1e6).toFixed(1)} MB`].join(' · ');
}

/** @param {Home} home @param {string} path @param {HTMLElement} strip */
async function showStrip(home, path, strip) {
  const answer = /** @type {any} */ (await home.attempt(() => askLong(`${path}/timeline?count=12`)));
  const frames = answer?.columns.frame ?? [];
  fill(strip, ...frames.map((/** @type {number} */ frame) => h('img', { alt: '', width: 40, height: 30, loading: 'lazy', src: `${path}/frames/${frame}` })));
}

/** @param {Home} home @param {string} path @param {string} name */
async function remove(home, path, name) {
  await home.attempt(async () => {
    const { undo } = await ask('DELETE', path);
    home.page?.toast(t('home.deleted', { name }), {
      label: t('undo'),
      act: () => home.attempt(async () => {
        await ask('POST', 'api/episodes/restore', { undo });
        await listEpisodes(home);
      }),
    });
    await listEpisodes(home);
  });
}
