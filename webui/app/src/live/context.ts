import { createContext } from 'svelte';
import type { Place } from '../page/place.svelte';
import type { SceneStage } from '../part/scene_stage.svelte';
import type { Tour } from '../tour/tour.svelte';
import type { Preference } from './preference.svelte';
import type { Replay } from './replay.svelte';
import type { Sound } from './sound.svelte';
import type { Orders } from './order.svelte';
import type { Station } from './station.svelte';

export const [getStation, setStation] = createContext<Station>();
export const [getPreference, setPreference] = createContext<Preference>();
export const [getPlace, setPlace] = createContext<Place>();
export const [getStage, setStage] = createContext<SceneStage>();
export const [getOrders, setOrders] = createContext<Orders>();
export const [getTour, setTour] = createContext<Tour>();
export const [getSound, setSound] = createContext<Sound>();
export const [getReplay, setReplay] = createContext<Replay>();
