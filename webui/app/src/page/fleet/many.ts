/** What only a fleet of many shows; loaded when there is one. */
export { default as FleetRow } from './FleetRow.svelte';
export { default as FleetTools } from './FleetTools.svelte';
