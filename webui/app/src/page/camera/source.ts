/** Kinds of cameras, each with an address as it is typed. */
export const SOURCES = [
  {
    key: 'v4l2',
    title: 'Webcam',
    uri: 'v4l2:///dev/video0?size=1280x720&fps=10',
    help: 'At the station itself; exposure=0.01 sets its exposure in seconds.',
  },
  {
    key: 'http',
    title: 'HTTP',
    uri: 'http://192.0.2.7/video?fps=10',
    help: 'A stream of JPEGs, or single JPEGs that are asked for again and again.',
  },
  {
    key: 'rtsp',
    title: 'RTSP',
    uri: 'rtsp://192.0.2.7/stream?transport=tcp&fps=10',
    help: 'A network camera.',
  },
  {
    key: 'folder',
    title: 'Folder',
    uri: 'folder:tank-1?fps=5',
    help: 'Pictures below the folder GRACE_CAMERA_DIR, for a try or a replay.',
  },
  {
    key: 'video',
    title: 'Video',
    uri: 'video:tank-1.mp4',
    help: 'A film below the folder GRACE_CAMERA_DIR.',
  },
] as const;

export type SourceKey = (typeof SOURCES)[number]['key'];

/** Whether a camera may ask for an account. */
export function asksAccount(uri: string): boolean {
  return /^(https?|rtsp):/.test(uri);
}

/** The first name of the form tank-1, tank-2 .. that nobody has. */
export function freeName(known: readonly string[]): string {
  let number = 1;
  while (known.includes(`tank-${number}`)) number++;
  return `tank-${number}`;
}
