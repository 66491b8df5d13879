// The recordings of past drives, as a part of the home screen.

/** @param {import('./home-screen.js').HomeScreen} home */
export async function listEpisodes(home) {
  void home;
}
