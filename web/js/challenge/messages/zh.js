// How the page leads to the challenge.
export default {
  'screen.challenge': '挑战',
};
