// Chooses the mood that the robot's face shows: it listens, is sure, is unsure, or is proud. Pure.

import { whoDrives } from './advice.js';

/** @param {Pick<import('./store.js').PageState, 'robot' | 'link' | 'readiness' | 'lead'>} state @returns {'listening' | 'sure' | 'unsure' | 'proud'} */
export function mood({ robot, link, readiness, lead }) {
  if (link !== 'open' || !robot || robot.lessons === 0) return 'listening';
  if (robot.asks_pilot || whoDrives(robot) === 'asks') return 'unsure';
  if (readiness?.stage === 'ready' && !lead) return 'proud';
  return robot.driven_by === 'robot' ? 'sure' : 'listening';
}
