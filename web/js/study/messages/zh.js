// The sentences that lead to a study.
export default {
  'screen.study': '研究',
  'settings.studies': '供教师和研究者',
  'settings.studies_hint': '衡量机器人被教得怎样，或开展有参与者的研究。',
};
