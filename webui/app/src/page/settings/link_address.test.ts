import { describe, expect, it } from 'vitest';
import { idOf, linkUri } from './link_address';

describe('links as they are entered', () => {
  it.each([
    ['xbee', '/dev/ttyUSB0', 'xbee:///dev/ttyUSB0?baud=115200'],
    ['xbee', ' 127.0.0.1:9 ', 'xbee://127.0.0.1:9'],
    ['serial', '/dev/ttyACM0', 'serial:///dev/ttyACM0?baud=115200'],
    ['udp-listen', '14550', 'udp://0.0.0.0:14550?listen=1'],
    ['udp-listen', '127.0.0.1:14550', 'udp://127.0.0.1:14550?listen=1'],
    ['tcp', 'sub.local:5760', 'tcp://sub.local:5760'],
    ['rockblock', '300234010753370', 'rockblock://300234010753370'],
    ['other', 'micromodem:///dev/ttyS1?us=1&peer=2', 'micromodem:///dev/ttyS1?us=1&peer=2'],
    ['tcp', '  ', ''],
  ])('%s at %s is %s', (way, place, uri) => {
    expect(linkUri(way, place, '115200')).toBe(uri);
  });

  it('makes an id of a name', () => {
    expect(idOf('  GRACE 4 (Ann’s) ')).toBe('grace-4-ann-s');
    expect(idOf('—')).toBe('');
  });
});
