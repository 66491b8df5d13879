// The sentences that lead to the challenge.
export default {
  'screen.challenge': '挑战',
};
