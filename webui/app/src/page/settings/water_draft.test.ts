import { describe, expect, test } from 'vitest';
import { Problem } from '../../api/problem';
import { parsePosition } from '../../text/position';
import { WaterDraft } from './water_draft.svelte';

const NEAR = { latitude: 42.7, longitude: -84.4 };
const TRIANGLE = [
  [0, 0],
  [0, 800],
  [600, 0],
] as const;

function drawn(): WaterDraft {
  const draft = new WaterDraft(null, NEAR, 'degrees');
  draft.name = 'Otter Bay';
  draft.depthMax = '12';
  draft.draw('outline');
  for (const [north, east] of TRIANGLE) draft.click([north, east], 'degrees');
  draft.finish();
  return draft;
}

describe('a position that is typed', () => {
  test.each([
    ['42.76, -84.38', 42.76, -84.38],
    ['42.76 -84.38', 42.76, -84.38],
    ['42 45.6 N 084 22.8 W', 42.76, -84.38],
    ['42° 45′ 36.0″ N 084° 22′ 48.0″ W', 42.76, -84.38],
    ['s 0 30, e 179 59 60', null, null],
    ['0 30 S, 179 30 E', -0.5, 179.5],
    ['91, 0', null, null],
    ['42 61 N 84 W', null, null],
    ['42.5 30 N 84 W', null, null],
    ['84 W 42 N', null, null],
    ['here', null, null],
  ])('%s', (text, latitude, longitude) => {
    const found = parsePosition(text);
    if (latitude === null) expect(found).toBeNull();
    else {
      expect(found?.latitude).toBeCloseTo(latitude, 9);
      expect(found?.longitude).toBeCloseTo(longitude, 9);
    }
  });
});

describe('a water that is drawn', () => {
  test('becomes a document around its outline', () => {
    const draft = drawn();
    expect(draft.check()).toEqual({});
    const { document } = draft.body();
    expect(document?.shoreline?.corners_m).toEqual(TRIANGLE.map((corner) => [...corner]));
    expect(document?.water).toEqual({
      x_min_m: -1,
      x_max_m: 601,
      y_min_m: -1,
      y_max_m: 801,
      depth_max_m: 12,
    });
    expect([document?.origin_latitude_deg, document?.origin_longitude_deg]).toEqual([42.7, -84.4]);
  });

  test('takes steps back one by one', () => {
    const draft = drawn();
    draft.setCorner(-1, 2, [700, 0]);
    expect(draft.shapes.outline[2]).toEqual([700, 0]);
    draft.undo();
    expect(draft.shapes.outline[2]).toEqual([600, 0]);
    draft.setCorner(-1, 2, null);
    expect(draft.shapes.outline).toHaveLength(3);
    draft.undo();
    expect(draft.shapes.outline).toEqual([]);
  });

  test('stays where it is on the earth as the map goes elsewhere', () => {
    const draft = drawn();
    draft.lookAt(42.71, -84.4);
    expect(draft.shapes.outline[0]?.[0]).toBeCloseTo(-1110.7, 0);
    expect(draft.shapes.outline[0]?.[1]).toBeCloseTo(0, 6);
  });

  test('has places by their position, in the frame of the water', () => {
    const draft = drawn();
    draft.addPlace();
    expect(draft.check()).toHaveProperty('places.0.position');
    draft.click([100, 50], 'minutes');
    expect(draft.check()).toEqual({});
    const place = draft.body().document?.places?.[0];
    expect(place?.north_m).toBeCloseTo(100, 3);
    expect(place?.east_m).toBeCloseTo(50, 3);
  });

  test('says beside each field what is missing, before and after it is sent', () => {
    const draft = new WaterDraft(null, NEAR, 'degrees');
    expect(Object.keys(draft.check()).sort()).toEqual(['depth_max_m', 'name', 'outline']);
    draft.refuse(
      new Problem(422, 'Unprocessable', '2 fields are wrong.', [
        { path: ['document', 'shoreline', 'corners_m'], message: 'corners_m crosses itself' },
        { path: ['document', 'places', '0', 'latitude_deg'], message: 'is too far' },
      ]),
    );
    expect(draft.faults).toEqual({
      outline: 'corners_m crosses itself.',
      'places.0.position': 'is too far.',
    });
  });
});
