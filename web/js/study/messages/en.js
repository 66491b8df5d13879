// The sentences that lead to a study.
export default {
  'screen.study': 'Studies',
  'settings.studies': 'For teachers and researchers',
  'settings.studies_hint': 'Measure how well a robot was taught, or run a study with participants.',
};
