import { mount } from 'svelte';
import App from './App.svelte';
import './style/token.css';
import './style/base.css';
import './style/control.css';
import 'leaflet/dist/leaflet.css';
import './style/map.css';

const target = document.getElementById('app');
if (target === null) throw new Error('the page has no #app');
mount(App, { target });
// Where a browser has none, as without encryption, the page works the same while it is open.
if (import.meta.env.PROD && 'serviceWorker' in navigator) {
  navigator.serviceWorker.register('/service-worker.js').catch((error: unknown) => {
    console.warn('the page without contact is not kept:', error);
  });
}
