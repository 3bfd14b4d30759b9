/** Pages of the manual: their words are written out at build time; this adds search and themes. */

import { mount } from 'svelte';
import Tools from './Tools.svelte';
import '../style/token.css';
import '../style/base.css';
import '../style/control.css';
import './manual.css';

const tools = document.getElementById('tools');
const found = document.getElementById('found');
if (tools === null || found === null) throw new Error('the page has no place for its tools');
mount(Tools, { target: tools, props: { found } });
