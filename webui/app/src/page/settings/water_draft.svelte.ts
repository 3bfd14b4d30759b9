import { Problem, sentence } from '../../api/problem';
import type {
  Area,
  ImportProposal,
  NewWater,
  NorthEast,
  Site,
  SiteDocument,
  Water,
  WaterChanges,
} from '../../api/types';
import { parseNumber } from '../../form/check';
import { northEast, wgs84 } from '../../text/frame';
import type { PositionFormat } from '../../text/position';
import { plainNumber } from '../../text/unit';
import {
  OUTLINE,
  boxAround,
  boxOf,
  fieldOf,
  placeOf,
  positionOf,
  sketchesOf,
  within,
  written,
  type FileDraft,
  type PlaceDraft,
} from './water_shape';

type Kind = Site['kind'];
interface Shapes {
  outline: readonly NorthEast[];
  keepOuts: readonly Area[];
  places: readonly PlaceDraft[];
}

/** Half of what the map of a new water shows at first, m. */
const HALF_M = 1500;
/** Room around what a file holds, as a share of it. */
const ROOM = 0.15;
const LEAST_CORNERS = 3;

/** A water as it is being made or changed; nothing leaves the browser before it is saved. */
export class WaterDraft {
  readonly water: Water | null;
  name = $state('');
  kind = $state<Kind>('lake');
  variable = $state('temperature');
  isRadioUnderWater = $state(false);
  depthMax = $state('');
  datum = $state('');
  tide = $state('0');
  altitude = $state('');
  shapes = $state.raw<Shapes>({ outline: [], keepOuts: [], places: [] });
  files = $state.raw<readonly FileDraft[]>([]);
  /** What the next clicks on the map are: corners of the outline, of a keep-out, or a place. */
  mode = $state.raw<
    { kind: 'outline' | 'keepout'; corners: NorthEast[] } | { place: number } | null
  >(null);
  /** Whose corners can be dragged: -1 the outline, from 0 a keep-out. */
  selected = $state<number | null>(null);
  faults = $state.raw<Record<string, string>>({});
  refusal = $state('');
  /** Frame and part of the ground that the map shows. */
  frame = $state.raw<Pick<Site, 'origin_latitude_deg' | 'origin_longitude_deg' | 'water'>>({
    origin_latitude_deg: 0,
    origin_longitude_deg: 0,
    water: boxAround(0, 0, HALF_M, HALF_M, 10),
  });
  #past = $state.raw<readonly Shapes[]>([]);

  /** @param water The one to be changed; `null` for a new one near a place. */
  constructor(
    water: Water | null,
    near: { latitude: number; longitude: number },
    format: PositionFormat,
  ) {
    this.water = water;
    if (!water) {
      this.#lookAt(near.latitude, near.longitude, HALF_M, HALF_M);
      return;
    }
    const { document: site } = water;
    this.name = site.name;
    this.kind = site.kind;
    this.variable = site.variable;
    this.isRadioUnderWater = site.radio_under_water;
    this.depthMax = plainNumber(site.water.depth_max_m);
    this.datum = site.depth_datum;
    this.tide = plainNumber(site.tide_offset_m);
    this.altitude = site.surface_altitude_m === null ? '' : plainNumber(site.surface_altitude_m);
    this.frame = site;
    this.shapes = {
      outline: site.chart ? [] : (site.shoreline?.corners_m ?? []),
      keepOuts: site.keep_outs,
      places: site.places.map(({ name, kind, latitude_deg, longitude_deg, depth_m }) => ({
        name,
        kind,
        ...written({ latitude: latitude_deg, longitude: longitude_deg }, format),
        depth: plainNumber(depth_m),
      })),
    };
  }

  /** Whether the outline is too large to be drawn by hand. */
  readonly isCharted = $derived.by(() => Boolean(this.water?.document.chart?.corners));
  readonly canUndo = $derived.by(() => this.#past.length > 0);
  readonly hasGrid = $derived.by(
    () =>
      this.files.some(({ proposal }) => proposal.kind === 'depths') ||
      Boolean(this.water?.document.bathymetry),
  );
  readonly hasOutline = $derived.by(
    () =>
      this.shapes.outline.length >= LEAST_CORNERS ||
      this.isCharted ||
      this.files.some(({ proposal, roles }) =>
        proposal.features.some((one) => (roles[one.number] ?? one.role) === 'outline'),
      ),
  );

  /** What the map draws under the shapes. */
  readonly site = $derived.by((): Site => {
    const kept = this.water?.document;
    return {
      name: this.name,
      kind: 'lake',
      variable: this.variable,
      radio_under_water: false,
      domain: this.frame.water,
      shoreline: null,
      bathymetry: kept?.bathymetry ?? null,
      islands: kept?.islands ?? [],
      keep_outs: [],
      places: [],
      depth_datum: '',
      tide_offset_m: 0,
      surface_altitude_m: null,
      chart: null,
      water: this.frame.water,
      origin_latitude_deg: this.frame.origin_latitude_deg,
      origin_longitude_deg: this.frame.origin_longitude_deg,
      ...(this.isCharted && { shoreline: kept?.shoreline ?? null }),
    };
  });

  /** Outline first, then keep-outs, as the map numbers them. */
  readonly areas = $derived.by((): Area[] => {
    const { outline, keepOuts } = this.shapes;
    return [{ name: OUTLINE, corners_m: outline }, ...keepOuts].filter(
      ({ corners_m }) => corners_m.length >= LEAST_CORNERS,
    );
  });

  readonly sketches = $derived.by(() => sketchesOf(this.files, this.frame));

  placeOf(place: PlaceDraft): NorthEast | null {
    const found = positionOf(place);
    return found && northEast(this.frame, found.latitude, found.longitude);
  }

  /** Show another part of the earth; what was drawn stays where it is on it. */
  lookAt(latitude: number, longitude: number): void {
    this.#lookAt(latitude, longitude, HALF_M, HALF_M);
  }

  #lookAt(latitude: number, longitude: number, tall: number, wide: number): void {
    const before = this.frame;
    if (this.water) return;
    this.frame = {
      origin_latitude_deg: latitude,
      origin_longitude_deg: longitude,
      water: boxAround(0, 0, tall, wide, 10),
    };
    const moved = ([north, east]: NorthEast): NorthEast => {
      const place = wgs84(before, north, east);
      return northEast(this.frame, place.latitude, place.longitude);
    };
    const { outline, keepOuts, places } = this.shapes;
    this.#past = [];
    this.shapes = {
      outline: outline.map(moved),
      keepOuts: keepOuts.map((area) => ({ ...area, corners_m: area.corners_m.map(moved) })),
      places,
    };
  }

  change(changes: Partial<Shapes>): void {
    this.#past = [...this.#past, this.shapes];
    this.shapes = { ...this.shapes, ...changes };
  }

  undo(): void {
    const { mode } = this;
    if (mode && 'corners' in mode && mode.corners.length > 0) {
      this.mode = { ...mode, corners: mode.corners.slice(0, -1) };
      return;
    }
    const last = this.#past.at(-1);
    if (!last) return;
    this.#past = this.#past.slice(0, -1);
    this.shapes = last;
    this.selected = null;
  }

  draw(kind: 'outline' | 'keepout'): void {
    this.selected = null;
    this.mode = { kind, corners: [] };
  }

  click(at: NorthEast, format: PositionFormat): void {
    const { mode } = this;
    if (!mode) return;
    if ('corners' in mode) {
      this.mode = { ...mode, corners: [...mode.corners, at] };
      return;
    }
    const place = wgs84(this.frame, at[0], at[1]);
    this.changePlace(mode.place, written(place, format));
    this.mode = null;
  }

  /** End what is being drawn: kept if it has three corners. */
  finish(): void {
    const { mode } = this;
    this.mode = null;
    if (!mode || !('corners' in mode) || mode.corners.length < LEAST_CORNERS) return;
    if (mode.kind === 'outline') {
      this.change({ outline: mode.corners });
      this.selected = -1;
      return;
    }
    const { keepOuts } = this.shapes;
    const names = keepOuts.map(({ name }) => name);
    let number = keepOuts.length + 1;
    while (names.includes(`Keep-out ${number}`)) number++;
    const area = { name: `Keep-out ${number}`, corners_m: mode.corners };
    this.change({ keepOuts: [...keepOuts, area] });
    this.selected = keepOuts.length;
  }

  /** Move a corner; `null` takes it away. */
  setCorner(area: number, corner: number, at: NorthEast | null): void {
    this.#edit(area, (corners) =>
      corners.flatMap((one, i) => (i === corner ? (at ? [at] : []) : [one])),
    );
  }

  /** Put another corner behind one. */
  insertCorner(area: number, corner: number, at: NorthEast): void {
    this.#edit(area, (corners) => corners.toSpliced(corner + 1, 0, at));
  }

  #edit(area: number, edit: (corners: readonly NorthEast[]) => readonly NorthEast[]): void {
    const { outline, keepOuts } = this.shapes;
    if (area < 0) {
      const corners = edit(outline);
      if (corners.length >= LEAST_CORNERS) this.change({ outline: corners });
      return;
    }
    const changed = keepOuts.map((one, i) =>
      i === area ? { ...one, corners_m: edit(one.corners_m) } : one,
    );
    if (changed.every(({ corners_m }) => corners_m.length >= LEAST_CORNERS)) {
      this.change({ keepOuts: changed });
    }
  }

  /** Index among keep-outs, or -1 for the outline, of an area as the map numbers it. */
  areaAt = (index: number): number =>
    this.shapes.outline.length >= LEAST_CORNERS ? index - 1 : index;

  changePlace(index: number, changes: Partial<PlaceDraft>): void {
    const { places } = this.shapes;
    this.change({ places: places.map((one, i) => (i === index ? { ...one, ...changes } : one)) });
  }

  addPlace(): void {
    const { places } = this.shapes;
    const place: PlaceDraft = {
      name: `Place ${places.length + 1}`,
      kind: 'dock',
      position: '',
      depth: '0',
    };
    this.change({ places: [...places, place] });
    this.mode = { place: places.length };
  }

  takeFile(proposal: ImportProposal): void {
    this.files = [...this.files, { proposal, areHeights: null, roles: {} }];
    if (!this.name.trim()) this.name = proposal.file.replace(/\.[^.]*$/, '');
    if (this.water || this.shapes.outline.length > 0) return;
    const { south, west, north, east } = proposal.extent;
    const middle = {
      latitude: proposal.origin_latitude_deg,
      longitude: proposal.origin_longitude_deg,
    };
    const origin = { origin_latitude_deg: middle.latitude, origin_longitude_deg: middle.longitude };
    const [tall] = northEast(origin, north, middle.longitude);
    const [, wide] = northEast(origin, middle.latitude, east);
    const isKnown = north > south && east > west;
    const room = (metres: number) => (isKnown ? (1 + ROOM) * Math.abs(metres) : HALF_M);
    this.#lookAt(middle.latitude, middle.longitude, room(tall), room(wide));
  }

  changeFile(index: number, changes: Partial<FileDraft>): void {
    this.files = this.files.map((one, i) => (i === index ? { ...one, ...changes } : one));
  }

  /** What is wrong before anything is sent, by field. */
  check(): Record<string, string> {
    const found: Record<string, string> = {};
    if (!this.name.trim()) found.name = 'A water needs a name.';
    const depth = parseNumber(this.depthMax);
    if (this.depthMax.trim() ? !(depth !== null && depth > 0) : !this.hasGrid) {
      found.depth_max_m = 'A depth above 0 m is needed, or a grid of depths.';
    }
    if (parseNumber(this.tide) === null) found.tide_offset_m = 'A number of metres is needed.';
    if (this.altitude.trim() && parseNumber(this.altitude) === null) {
      found.surface_altitude_m = 'A number of metres is needed, or nothing.';
    }
    if (!this.hasOutline && !this.water && !this.hasGrid) {
      found.outline = 'Draw the outline, or read it from a file.';
    }
    this.shapes.places.forEach((place, i) => {
      if (!place.name.trim()) found[`places.${i}.name`] = 'A place needs a name.';
      if (!positionOf(place)) {
        found[`places.${i}.position`] =
          'Type latitude and longitude, such as 42° 45.600′ N 084° 22.800′ W.';
      }
      const depth = parseNumber(place.depth);
      if (depth === null || depth < 0) found[`places.${i}.depth_m`] = 'A depth from 0 m is needed.';
    });
    return found;
  }

  /** What the station is asked to keep. */
  body(): NewWater & WaterChanges {
    const depth = parseNumber(this.depthMax);
    const document = this.#document(depth);
    return {
      name: this.name.trim(),
      kind: this.kind,
      variable: this.variable,
      radio_under_water: this.isRadioUnderWater,
      depth_datum: this.datum.trim(),
      tide_offset_m: parseNumber(this.tide) ?? 0,
      ...(this.altitude.trim() && { surface_altitude_m: parseNumber(this.altitude) }),
      ...(depth !== null && this.depthMax.trim() && { depth_max_m: depth }),
      ...(document && { document }),
      proposals: this.files.map(({ proposal, areHeights, roles }) => ({
        proposal: proposal.proposal,
        are_heights: areHeights,
        roles,
      })),
    };
  }

  #document(depth: number | null): SiteDocument | null {
    const { outline, keepOuts, places } = this.shapes;
    const isDrawn = outline.length >= LEAST_CORNERS;
    const kept = this.water?.document;
    if (!kept && !isDrawn) return null;
    const isSame = isDrawn && outline === kept?.shoreline?.corners_m;
    const around = boxOf(outline, depth ?? kept?.water.depth_max_m ?? 10);
    const box = isDrawn && !isSame ? around : (kept?.water ?? around);
    const water = { ...box, depth_max_m: depth ?? box.depth_max_m };
    const origin = this.frame;
    return {
      ...(kept ?? { islands: [] }),
      name: this.name.trim(),
      kind: this.kind,
      variable: this.variable,
      radio_under_water: this.isRadioUnderWater,
      origin_latitude_deg: origin.origin_latitude_deg,
      origin_longitude_deg: origin.origin_longitude_deg,
      water,
      domain: isSame || !isDrawn ? within(kept?.domain ?? water, water) : water,
      shoreline: isDrawn ? { name: 'Shore', corners_m: [...outline] } : (kept?.shoreline ?? null),
      keep_outs: keepOuts.map((area) => ({ ...area, name: area.name.trim() })),
      places: places.map((place) => placeOf(place, origin)),
    };
  }

  /** Note a refusal of the station, beside its fields as far as they are shown. */
  refuse(error: unknown): void {
    this.refusal = sentence(error);
    const faults = error instanceof Problem ? error.errors : [];
    this.faults = Object.fromEntries(
      faults.map(({ path, message }) => [fieldOf(path), `${message}.`.replace(/\.\.$/, '.')]),
    );
  }
}
