// The sentences that lead to a study.
export default {
  'screen.study': 'Estudios',
  'settings.studies': 'Para docentes e investigadores',
  'settings.studies_hint': 'Mide lo bien que se ha enseñado a un robot, o haz un estudio con participantes.',
};
