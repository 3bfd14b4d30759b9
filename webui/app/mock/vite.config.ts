import { mergeConfig } from 'vite';
import product from '../vite.config';
import { mockStation } from './plugin';

/** The app against a fake station, for work on the app alone. */
export default mergeConfig(product, { plugins: [mockStation()] });
