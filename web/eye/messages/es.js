// The sentences on the page of the robot's eye.
export default {
  'eye.title': 'El ojo del robot',
  'eye.begin': 'Usar esta cámara',
  'eye.insecure': 'El teléfono solo deja que una página use su cámara por https: arranca el robot con --tls.',
  'eye.none': 'Este dispositivo no tiene cámara. Abre esta página en uno que la tenga.',
  'eye.in_use': 'Otro programa usa la cámara. Ciérralo e inténtalo de nuevo.',
  'eye.refused': 'El navegador ha denegado la cámara, u otro programa la usa. Permítela e inténtalo de nuevo.',
  'eye.stands': 'La cámara funciona. El robot está parado.',
  'eye.drives': 'La cámara funciona. ¡El robot está en marcha!',
  'eye.another': 'Ahora el ojo es otro teléfono. Recarga esta página para que lo sea este.',
  'eye.viewer': 'Este navegador solo puede mirar. Escanea el código del ojo del robot.',
  'eye.other_camera': 'El robot usa otra cámara. Para usar esta, arranca el robot con --camera phone.',
  'eye.rate': '{n} imágenes por segundo',
};
