// <study-screen>: a guided trial of one person, and studies with participants.
// Without a session the screen is for the researcher; during a session it leads the participant.

import { ask } from '../api.js';
import { minutes } from '../components/teach-panel.js';
import { Screen, contentOf, segments } from '../components/screen.js';
import { append, fill, h } from '../dom.js';
import { language, t } from '../i18n.js';
import { inWords, questionForm } from './questions.js';
import { drawOutcome } from './result.js';
import { learnSession, refreshSession } from './session.js';

const OWN = 'plan';

export class StudyScreen extends Screen {
  body = h('div', { class: 'stack' });
  refusal = h('p', { class: 'panel refusal', role: 'alert', hidden: true });
  /** @type {string | null} the name of the shown study */
  chosen = null;
  drawn = '';
  /** Number of requests for the list. If two requests are under way, only the answer to the newer one is shown. */
  listing = 0;

  async build() {
    append(this, [this.refusal, this.body]);
    if (this.page) await refreshSession(this.page); // the page was just loaded, and does not know the session yet
    if (!this.isConnected) return undefined;
    /** @type {Promise<void> | undefined} */
    let shown;
    this.watch(['lead'], ({ lead }) => { shown = this.show(lead?.own); });
    return shown;
  }

  /** @param {any} session */
  async show(session) {
    const stamp = session?.phases ? JSON.stringify([session.participant, session.step, session.position, session.phase, session.is_driving]) : '';
    if (stamp && stamp === this.drawn) {
      this.progress(session);
      return;
    }
    const isNew = stamp !== this.drawn;
    this.drawn = stamp;
    if (!session?.phases) { // a viewer gets only the state of the session
      await this.list();
      return;
    }
    this.refuse('');
    fill(this.body, ...this.lead(session));
    if (session.step === 'done' && session.shows_result) await this.showResult(session.study, session.participant);
    this.progress(session);
    if (isNew) document.querySelector('main#other')?.scrollTo(0, 0);
  }

  /** Show a refusal until it has been read. @param {string} sentence */
  refuse(sentence) {
    this.refusal.hidden = !sentence;
    this.refusal.textContent = sentence;
  }

  /** @param {() => Promise<any>} act @returns {Promise<any>} */
  async act(act) {
    try {
      const answer = await act();
      this.refuse('');
      return answer;
    } catch (error) {
      this.refuse(error instanceof TypeError ? t('unreachable') : /** @type {Error} */ (error).message);
      this.refusal.scrollIntoView({ block: 'nearest' });
      return undefined;
    }
  }

  /** Change the session, and show it. @param {string} method @param {string} path @param {any} [body] */
  async step(method, path, body) {
    const answer = await this.act(() => ask(method, path, body));
    if (answer && this.page) await learnSession(this.page, Promise.resolve(answer)); // this also shows the session
    return answer;
  }

  // What the researcher sees ---------------------------------------------------------------------------

  async list() {
    const turn = (this.listing += 1);
    const answer = await this.act(() => ask('GET', 'api/studies'));
    if (!answer || !this.isConnected || turn !== this.listing) return;
    const names = /** @type {string[]} */ (answer.studies);
    if (!this.chosen || !names.includes(this.chosen)) this.chosen = names[0] ?? null;
    const study = this.chosen && (await this.act(() => ask('GET', `api/studies/${encodeURIComponent(this.chosen ?? '')}`)));
    const pick = h('select', { 'aria-label': t('study.which'), onchange: () => {
      this.chosen = pick.value;
      this.list();
    } }, ...names.map((name) => h('option', { selected: name === this.chosen }, name)));
    if (this.drawn || turn !== this.listing) return; // a session has begun meanwhile, or another study was chosen
    fill(this.body, ...this.trial(), h('h2', {}, t('study.studies')), ...(names.length ? [pick] : [h('p', { class: 'lead' }, t('study.none'))]),
      ...(study ? this.study(study) : []), this.creation(!names.length));
  }

  /** The form that begins the paper's trial of one person. */
  trial() {
    const hint = h('p', { class: 'hint' });
    const chosen = { trial: 1, teach_s: 90 };
    const describe = () => { hint.textContent = t(`study.trial_${chosen.trial}`); };
    const choice = (/** @type {string} */ name, /** @type {'trial' | 'teach_s'} */ field, /** @type {[string, string][]} */ options) =>
      segments(name, options, options[0][0], (/** @type {string} */ value) => {
        chosen[field] = Number(value);
        describe();
      });
    describe();
    return [
      h('p', { class: 'lead' }, t('study.lead')),
      choice(t('study.which_trial'), 'trial', ['1', '2', '3'].map((n) => [n, t('study.trial_n', { n })])),
      hint,
      choice(t('study.how_long'), 'teach_s', ['90', '180'].map((s) => [s, t('study.teach_time', { s })])),
      h('p', { class: 'hint' }, t('study.empty')),
      h('button', { type: 'button', class: 'primary wide', onclick: () => this.step('POST', 'api/session', chosen) }, t('study.begin_trial')),
    ];
  }

  /** @param {string} study @param {string} code */
  async showResult(study, code) {
    const place = h('div', { class: 'stack' }); // the place below the participant's line, where the answer is shown
    this.body.append(place);
    const answer = await this.act(() => ask('GET', `api/studies/${encodeURIComponent(study)}/sessions/${code}`));
    if (answer) append(place, answer.conditions.flatMap(drawOutcome));
  }

  /** @param {any} study */
  study(study) {
    const code = h('input', { 'aria-label': t('study.code'), placeholder: 'P07', maxlength: 7, autocomplete: 'off', autocapitalize: 'characters' });
    const begin = async (/** @type {Event} */ event) => {
      event.preventDefault();
      await this.step('POST', 'api/session', { study: study.name, participant: code.value.trim().toUpperCase() });
    };
    return [
      h('div', { class: 'panel stack' }, h('h2', {}, study.title),
        h('progress', { max: study.participants, value: study.done, 'aria-label': t('study.progress', { done: study.done, n: study.participants }) }),
        h('p', {}, t('study.progress', { done: study.done, n: study.participants })),
        h('p', { class: 'hint' }, study.next_order ? t('study.next', { order: study.next_order.join(', ') }) : t('study.full')),
        h('form', { class: 'row', onsubmit: begin }, code, h('button', { class: 'primary' }, t('study.begin'))),
        h('p', { class: 'hint' }, t('study.code_hint')),
        h('a', { class: 'button', href: `api/studies/${encodeURIComponent(study.name)}/zip`, download: `${study.name}.zip` }, t('study.download'))),
      study.sessions.length ? h('h2', {}, t('study.sessions')) : null,
      h('div', { class: 'stack', role: 'list' }, ...study.sessions.map((/** @type {any} */ session) => this.line(study, session))),
    ].filter((part) => part !== null);
  }

  /** @param {any} study @param {any} session */
  line(study, session) {
    const { participant: code, step, order, position: n, of, fault } = session;
    const state = fault || (step === 'done' ? t('study.step.done') : `${t('study.at', { n, of })}, ${t(`study.step.${step}`)}`);
    return h('div', { class: 'panel stack', role: 'listitem' },
      h('div', { class: 'row' }, h('h3', { class: 'grow' }, code), h('span', {}, state)),
      h('small', {}, order.join(', ')),
      h('div', { class: 'row' },
        fault ? null : step === 'done' ? study.shows_result && this.resultButton(study.name, code) : h('button', { type: 'button', onclick: () => this.step('POST', 'api/session', { study: study.name, participant: code }) }, t('study.resume', { code })),
        h('button', { type: 'button', onclick: () => this.withdraw(study.name, code) }, t('study.withdraw', { code }))));
  }

  /** @param {string} study @param {string} code */
  resultButton(study, code) {
    const show = async () => {
      fill(this.body, h('h2', {}, code), h('button', { type: 'button', onclick: () => this.list() }, t('study.studies')));
      await this.showResult(study, code);
    };
    return h('button', { type: 'button', onclick: show }, t('study.result', { code }));
  }

  /** @param {string} study @param {string} code */
  withdraw(study, code) {
    this.page?.toast(t('study.withdraw_really', { code }), { label: t('study.withdraw_yes'), act: async () => {
      const answer = await this.act(() => ask('DELETE', `api/studies/${encodeURIComponent(study)}/sessions/${code}`));
      await this.list();
      if (answer) this.page?.toast(t('study.withdrawn', { code, n: answer.deleted.length, r: answer.deleted.filter((/** @type {string} */ path) => path.endsWith('.mcap')).length }));
    } });
  }

  /** @param {boolean} isFirst */
  creation(isFirst) {
    let source = '1';
    const name = h('input', { 'aria-label': t('study.name'), placeholder: t('study.name'), maxlength: 40, required: true });
    const file = h('input', { type: 'file', accept: '.toml', 'aria-label': t('study.plan') });
    const place = h('div', { hidden: true }, file);
    const kinds = h('select', { 'aria-label': t('study.new'), onchange: () => {
      source = kinds.value;
      place.hidden = source !== OWN;
    } }, ...['1', '2', '3'].map((n) => h('option', { value: n }, t('study.trial', { n }))), h('option', { value: OWN }, t('study.plan')));
    const create = async (/** @type {Event} */ event) => {
      event.preventDefault();
      const made = await this.act(async () => {
        const plan = source === OWN ? { plan: new TextDecoder().decode(await contentOf(file.files?.[0] ?? new Blob())) } : { trial: Number(source) };
        return ask('POST', 'api/studies', { name: name.value.trim(), ...plan });
      });
      if (!made) return;
      this.chosen = made.name;
      await this.list();
    };
    return h('details', { class: 'panel', open: isFirst }, h('summary', {}, t('study.new')),
      h('form', { class: 'stack', onsubmit: create }, name, kinds, place, h('button', {}, t('study.create'))));
  }

  // What the participant sees --------------------------------------------------------------------------

  /** @param {any} session @returns {HTMLElement[]} */
  lead(session) {
    const heading = h('h2', {}, t('study.part', { n: session.position, of: session.of }));
    if (session.step === 'consent') return [this.consent(session), this.forResearcher(session)];
    if (session.step === 'questions') {
      return [heading, questionForm(session.questions, session.answers, (send) => this.act(send), (answer) => this.page && learnSession(this.page, Promise.resolve(answer))), this.forResearcher(session)];
    }
    if (session.step === 'done') {
      return [h('p', { class: 'lead' }, t('study.thanks')),
        h('button', { type: 'button', class: 'wide', onclick: () => this.step('DELETE', 'api/session') }, t('study.close'))];
    }
    const text = inWords(session.instructions);
    return [heading, ...(text ? [h('p', { class: 'prose' }, text)] : []), this.phases(session), ...this.go(session), this.forResearcher(session)];
  }

  /** @param {any} session */
  consent(session) {
    return h('div', { class: 'stack' }, h('p', { class: 'panel prose' }, inWords(session.consent)),
      h('button', { type: 'button', class: 'primary wide', onclick: () => this.step('POST', 'api/session/consent', { language }) }, t('study.agree')));
  }

  /** @param {any} session */
  phases(session) {
    this.bars = session.phases.map(() => h('i'));
    this.left = session.phases.map(() => h('span', { class: 'bar-figure' }));
    const steps = session.phases.map((/** @type {any} */ phase, /** @type {number} */ i) => h('li', { class: i === session.phase ? 'now' : '' },
      h('b', {}, `${i + 1}. ${t(`study.${phase.kind}`)}`), this.left[i],
      h('span', { class: 'hint' }, inWords(phase.instructions) || t(`study.${phase.kind}_how`)),
      h('span', { class: 'track', 'aria-hidden': 'true' }, this.bars[i])));
    return h('div', { class: 'panel stack' }, h('h3', {}, t('study.what')), h('ol', { class: 'steps' }, ...steps), h('p', { class: 'hint' }, t('study.clock')));
  }

  /** @param {any} session */
  progress({ phases, step }) {
    if (step !== 'drive' && step !== 'ready') return;
    phases.forEach((/** @type {any} */ { seconds, done_s: done }, /** @type {number} */ i) => {
      this.bars[i].style.transform = `scaleX(${step === 'drive' ? Math.min(1, done / seconds) : 0})`;
      this.left[i].textContent = minutes(step === 'drive' ? seconds - done : seconds);
    });
  }

  /** @param {any} session */
  go(session) {
    if (session.step === 'drive' && session.is_driving) return [h('a', { class: 'button primary wide', href: '#drive' }, t('study.wheel'))];
    const confirmed = h('input', { type: 'checkbox' });
    const start = async () => {
      const answer = await this.step('POST', 'api/session/drive', { confirmed: confirmed.checked });
      if (answer?.session?.is_driving) location.hash = 'drive';
    };
    return [
      ...(session.needs_confirmation ? [h('label', { class: 'choice' }, confirmed, h('span', {}, t('study.place', { world: session.world })))] : []),
      h('button', { type: 'button', class: 'primary wide', onclick: start }, t(session.step === 'drive' ? 'study.go_on' : 'study.start')),
    ];
  }

  /** @param {any} session */
  forResearcher(session) {
    const button = (/** @type {string} */ key, /** @type {() => any} */ act) => h('button', { type: 'button', onclick: act }, t(key));
    return h('details', { class: 'panel' }, h('summary', {}, t('study.researcher')),
      h('div', { class: 'stack' }, h('p', { class: 'hint' }, t('study.session', { code: session.participant })), session.fault ? h('p', {}, session.fault) : null,
        h('div', { class: 'row' }, button('study.leave', () => this.step('DELETE', 'api/session')),
          session.step === 'drive' ? button('study.anew', () => this.step('POST', 'api/session/drive', { anew: true, confirmed: true })) : null)));
  }

  /** @type {HTMLElement[]} */
  bars = [];
  /** @type {HTMLElement[]} */
  left = [];
}

customElements.define('study-screen', StudyScreen);
