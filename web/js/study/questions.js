// Shows the questions after a part of a study.
// The questions use native radios, sliders and fields, so that keyboards and screen readers work.
// Each answer is sent immediately, so that a reload of the page loses no answer.

import { ask } from '../api.js';
import { h, say } from '../dom.js';
import { language, t } from '../i18n.js';

/** @typedef {Record<string, string>} Words */
/** @typedef {{name: string, text: Words, kind: string, least: number, most: number, step: number, low: Words, high: Words, options: Words[]}} Question */

const MOST_RADIOS = 11;

/** Return a text in the page's language, or else in English, or else in any language. @param {Words} words */
export const inWords = (words) => words[language] ?? words.en ?? Object.values(words)[0] ?? '';

/**
 * @param {Question[]} questions
 * @param {Record<string, string>} answers  the answers so far
 * @param {(send: () => Promise<any>) => Promise<any>} attempt  runs a request that may be refused
 * @param {(answer: any) => void} done  called with the last request's result when all are answered
 */
export function questionForm(questions, answers, attempt, done) {
  /** @type {Record<string, number | string>} */
  const given = {};
  for (const { name, kind } of questions) if (name in answers) given[name] = kind === 'text' ? answers[name] : Number(answers[name]);
  /** @type {Promise<any>} send one request after the other, because the last answer to a question must arrive last */
  let sending = Promise.resolve();
  const post = (/** @type {any} */ body) => (sending = sending.then(() => attempt(() => ask('POST', 'api/session/answers', body))));
  const parts = questions.map((question) => {
    const missing = h('p', { class: 'hint', role: 'alert' });
    const take = (/** @type {number | string} */ value) => {
      given[question.name] = value;
      say(missing, '');
      return post({ answers: { [question.name]: value } });
    };
    const field = question.kind === 'text' ? written(question, given, take) : chosen(question, given, take);
    field.append(missing);
    return { question, field, missing };
  });
  const send = async (/** @type {Event} */ event) => {
    event.preventDefault();
    // A question that asks for a text need not be answered.
    for (const { name, kind } of questions) if (kind === 'text') given[name] ??= '';
    const open = parts.filter(({ question }) => !(question.name in given));
    for (const { missing } of open) say(missing, t('study.missing'));
    if (open.length) {
      open[0].field.querySelector('input')?.focus();
      open[0].field.scrollIntoView({ block: 'center' });
      return;
    }
    const answer = await post({ answers: given, done: true });
    if (answer) done(answer);
  };
  return h('form', { class: 'stack', onsubmit: send, novalidate: true }, h('h2', {}, t('study.questions')),
    ...parts.map(({ field }) => field), h('button', { class: 'primary wide' }, t('study.send')));
}

/** @param {Question} question @param {Record<string, any>} given @param {(value: number) => void} take */
function chosen(question, given, take) {
  const legend = h('legend', {}, inWords(question.text));
  const { least, most, step } = question;
  if (question.kind === 'scale' && (most - least) / step + 1 > MOST_RADIOS) return slider(question, legend, given, take);
  const values = question.kind === 'choice'
    ? question.options.map((words, i) => /** @type {[number, string]} */ ([i + 1, inWords(words)]))
    : Array.from({ length: Math.floor((most - least) / step) + 1 }, (_, i) => /** @type {[number, string]} */ ([least + i * step, String(least + i * step)]));
  const radios = values.map(([value, text]) => {
    const end = value === least ? inWords(question.low) : value === most ? inWords(question.high) : '';
    return h('label', { class: question.kind === 'choice' ? 'choice' : 'point' },
      h('input', { type: 'radio', name: question.name, value, checked: given[question.name] === value, onchange: () => take(value) }),
      h('span', {}, text), question.kind === 'scale' && end ? h('span', { class: 'unseen' }, end) : null);
  });
  return h('fieldset', { class: 'panel stack' }, legend,
    ...(question.kind === 'choice' ? radios : [h('div', { class: 'points' }, ...radios), ends(question)]));
}

/** Make a slider that has no value until it is touched. @param {Question} question @param {HTMLElement} legend @param {Record<string, any>} given @param {(value: number) => void} take */
function slider(question, legend, given, take) {
  const { name, least, most, step } = question;
  const shown = h('output');
  const range = h('input', { type: 'range', min: least, max: most, step, 'aria-label': inWords(question.text), value: given[name] ?? (least + most) / 2 });
  const show = () => {
    const isSet = name in given;
    range.classList.toggle('unset', !isSet);
    range.setAttribute('aria-valuetext', isSet ? `${given[name]}` : t('study.unset'));
    say(shown, isSet ? `${given[name]}` : '–');
  };
  const set = () => {
    given[name] = Number(range.value);
    show();
  };
  range.addEventListener('input', set);
  // Take a press or a key that leaves the slider in the middle as an answer, because no event `input` reports it.
  range.addEventListener('pointerup', () => (set(), take(Number(range.value))));
  range.addEventListener('keydown', (event) => [' ', 'Enter'].includes(event.key) && (event.preventDefault(), event.stopPropagation(), set(), take(Number(range.value))));
  range.addEventListener('change', () => take(Number(range.value)));
  show();
  return h('fieldset', { class: 'panel stack' }, legend, h('div', { class: 'slider' }, range, shown), ends(question));
}

/** @param {Question} question */
const ends = ({ low, high }) => h('div', { class: 'ends', 'aria-hidden': 'true' }, h('small', {}, inWords(low)), h('small', {}, inWords(high)));

/** @param {Question} question @param {Record<string, any>} given @param {(value: string) => void} take */
function written(question, given, take) {
  const area = h('textarea', { rows: 3, maxlength: 1000, 'aria-label': inWords(question.text), onchange: () => take(area.value) });
  area.value = given[question.name] ?? '';
  return h('fieldset', { class: 'panel stack' }, h('legend', {}, inWords(question.text)), area);
}
