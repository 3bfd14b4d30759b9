/** Stands where the 3D view will be: a turning wire tank. */
export const SCENE = `<!doctype html><meta charset="utf-8"><style>
html,body{margin:0;height:100%;overflow:hidden;background:#0d1319}canvas{width:100%;height:100%;display:block}
</style><canvas></canvas><script>
const c=document.querySelector('canvas'),x=c.getContext('2d');
const box=[];for(const a of[-1,1])for(const b of[-1,1])for(const d of[-.5,.5])box.push([a*1.5,b,d]);
function p(v,t){const s=Math.sin(t),o=Math.cos(t),X=v[0]*o-v[1]*s,Y=v[0]*s+v[1]*o,Z=v[2];const k=c.height*.9/(5+Y);
return[c.width/2+X*k,c.height/2+(Z+Y*.25)*k]}
function draw(n){const t=.6+n/20000;c.width=c.clientWidth;c.height=c.clientHeight;
x.strokeStyle='#3a5268';x.lineWidth=1;for(let i=0;i<8;i++)for(let j=i+1;j<8;j++){const d=box[i].filter((v,k)=>v!==box[j][k]).length;
if(d===1){x.beginPath();x.moveTo(...p(box[i],t));x.lineTo(...p(box[j],t));x.stroke()}}
const cs=['#7c6cd6','#56a0e6','#a0f0e1'];for(let i=0;i<220;i++){const u=i/220*14+n/4000,f=u%1;
const v=[1.3*Math.sin(u*.31),.85*Math.sin(u*.21+1),-.45+.85*Math.sin(Math.PI*f)],w=p(v,t);
x.fillStyle=cs[2-Math.floor(f*3)];x.fillRect(w[0],w[1],2.5,2.5)}
requestAnimationFrame(draw)}requestAnimationFrame(draw)
</script>`;
