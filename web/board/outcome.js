// Makes the sentence that tells the teacher how one robot has carried out an order.

import { t } from '../js/i18n.js';

/** @typedef {{number: number, name: string, did: string, model: string, detail: string}} Outcome */

/** @param {Outcome} one */
export function tellOutcome(one) {
  const did = t(`board.end.did.${one.did}`, { ...one });
  const isSaved = one.model && one.did !== 'keep'; // `model` is empty if the old model had no examples and was not saved
  return isSaved ? t('board.end.saved', { did, model: one.model }) : did;
}
