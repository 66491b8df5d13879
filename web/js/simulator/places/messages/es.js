// The places of a simulated robot.
export default {
  'settings.world': 'Lugar',
  'settings.world_hint': 'El robot simulado se coloca en la salida de ese lugar y conserva todo lo aprendido.',
  'world.box': 'Una caja vacía',
  'world.clutter': 'Una sala con muchos objetos',
  'world.corridor': 'Un pasillo alrededor de estantes',
  'world.follow': 'Una sala con algo que seguir',
  'world.fork': 'Una sala con una bifurcación',
  'world.office': 'Una oficina',
  'world.push': 'Una sala con una caja que empujar',
};
