/** Links as a person enters them: how a robot is reached, and where; the URI is made of both. */

export interface LinkWay {
  key: string;
  title: string;
  /** What is asked for. */
  place: string;
  example: string;
  hasBaud: boolean;
  uri: (place: string, baud: string) => string;
}

const line = (scheme: string) => (place: string, baud: string) =>
  place.startsWith('/') ? `${scheme}://${place}?baud=${baud}` : `${scheme}://${place}`;

export const LINK_WAYS: readonly LinkWay[] = [
  {
    key: 'xbee',
    title: 'XBee radio',
    place: 'Serial port, or host:port',
    example: '/dev/ttyUSB0',
    hasBaud: true,
    uri: line('xbee'),
  },
  {
    key: 'serial',
    title: 'MAVLink on a serial line',
    place: 'Serial port',
    example: '/dev/ttyUSB0',
    hasBaud: true,
    uri: line('serial'),
  },
  {
    key: 'udp-listen',
    title: 'MAVLink by UDP, the robot calls',
    place: 'Port of this station',
    example: '14550',
    hasBaud: false,
    uri: (place) => `udp://${place.includes(':') ? place : `0.0.0.0:${place}`}?listen=1`,
  },
  {
    key: 'udp',
    title: 'MAVLink by UDP, the station calls',
    place: 'host:port of the robot',
    example: '192.168.2.2:14550',
    hasBaud: false,
    uri: (place) => `udp://${place}`,
  },
  {
    key: 'tcp',
    title: 'MAVLink by TCP',
    place: 'host:port of the robot',
    example: '192.168.2.2:5760',
    hasBaud: false,
    uri: (place) => `tcp://${place}`,
  },
  {
    key: 'rockblock',
    title: 'Iridium by RockBLOCK',
    place: 'IMEI of its modem',
    example: '300234010753370',
    hasBaud: false,
    uri: (place) => `rockblock://${place}`,
  },
  {
    key: 'directip',
    title: 'Iridium by DirectIP',
    place: 'IMEI of its modem',
    example: '300234010753370',
    hasBaud: false,
    uri: (place) => `directip://${place}`,
  },
  {
    key: 'cameras',
    title: 'Cameras over the water',
    place: 'Name of the robot whose tags it carries',
    example: 'mini-1',
    hasBaud: false,
    uri: (place) => `cameras:///?tags=${encodeURIComponent(place)}`,
  },
  {
    key: 'other',
    title: 'Another, by its URI',
    place: 'URI',
    example: 'cloudloop://thing?imei=300234010753370',
    hasBaud: false,
    uri: (place) => place,
  },
];

export function linkUri(way: string, place: string, baud: string): string {
  const typed = place.trim();
  const found = LINK_WAYS.find(({ key }) => key === way);
  return typed && found ? found.uri(typed, baud) : '';
}

/** A short id made of a name: what the station takes, or "" where nothing of it is left. */
export function idOf(name: string): string {
  return name
    .toLowerCase()
    .replace(/[^a-z0-9]+/g, '-')
    .replace(/^-+|-+$/g, '')
    .slice(0, 40);
}
