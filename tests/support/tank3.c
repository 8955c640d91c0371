/* The tank as an FMU of FMI 3.0: co-simulation with event mode and model exchange, and with SE two partitions for scheduled
 * execution. It is correct, or has the fault that a macro FAULT_... names. */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>
#include <stdio.h>
#include <math.h>
#include <fenv.h>
#include <unistd.h>
#include <pthread.h>
#include <signal.h>
#include <fcntl.h>
#include "fmi3Functions.h"
#define OK fmi3OK
typedef enum { INST=1, INIT=2, EVENT=4, CONT=8, STEP=16, TERM=32, CONFIG=64, ACT=128 } Mode;
typedef struct { double time,h,k,g,u,d,next,scale,derc,uf,sum,ts; int n,sel,s2,full,c,cs,clk; char label[64]; unsigned char blob[256],echo[256]; size_t nblob,necho; } Vals;
typedef struct { Vals v; fmi3InstanceEnvironment env; fmi3LogMessageCallback log; fmi3LockPreemptionCallback lock,unlock; int logging,kind,mode,ev,early; double scale0; pthread_t th; } I;
static void say(I*i,fmi3Status s,const char*cat,const char*m){ if(i->log&&(i->logging||s!=OK)) i->log(i->env,s,cat,m); }
static fmi3Status bad(I*i,const char*m){ say(i,fmi3Error,"logStatusError",m); return fmi3Error; }
static void start(I*i){ Vals*v=&i->v; memset(v,0,sizeof *v); v->h=0.2;v->k=2;v->g=3;v->u=1;v->sel=1;v->scale=i->scale0;strcpy(v->label,"tank");v->next=0.25;v->uf=1; v->blob[0]=1; v->nblob=1; v->echo[0]=1; v->necho=1;
}
static _Thread_local int begun;
#ifdef FAULT_leaves_threads
static void*idle(void*x){ for(;;) usleep(100000); return 0; }
#endif
static I*make(const char*name,const char*tok,const char*res,int logging,fmi3InstanceEnvironment e,fmi3LogMessageCallback l,int kind){
  I*i=calloc(1,sizeof *i); i->env=e;i->log=l;i->logging=logging;i->kind=kind;i->mode=INST;
  if(!name||!*name||!tok||strcmp(tok,GUID)){ bad(i,"wrong name or token"); free(i); return NULL; }
  char p[4096]; snprintf(p,4000,"%s",res?res:""); size_t L=strlen(p); if(L&&p[L-1]!='/') strcat(p,"/"); strcat(p,"scale.txt");
#ifdef FAULT_ascii_path
  for(char*q=p;*q;q++) if((unsigned char)*q>127) *q='?';
#endif
  FILE*f=fopen(p,"r"); if(!f||fscanf(f,"%lf",&i->scale0)!=1){ bad(i,"scale.txt cannot be read"); if(f) fclose(f); free(i); return NULL; } fclose(f);
#ifdef FAULT_sets_environment
  setenv("TANK_HOME","/opt/tank",1);
#endif
#ifdef FAULT_leaves_threads
  pthread_create(&i->th,0,idle,0); pthread_detach(i->th);
#endif
  begun=1; start(i); say(i,OK,"logStatusOK","instantiated"); return i; }
const char*fmi3GetVersion(void){return "3.0";}
fmi3Instance fmi3InstantiateModelExchange(fmi3String n,fmi3String t,fmi3String r,fmi3Boolean v,fmi3Boolean l,fmi3InstanceEnvironment e,fmi3LogMessageCallback m){
#ifdef SE
  return NULL;
#else
  return make(n,t,r,l,e,m,1);
#endif
}
fmi3Instance fmi3InstantiateCoSimulation(fmi3String n,fmi3String t,fmi3String r,fmi3Boolean v,fmi3Boolean l,fmi3Boolean ev,fmi3Boolean early,const fmi3ValueReference q[],size_t nq,fmi3InstanceEnvironment e,fmi3LogMessageCallback m,fmi3IntermediateUpdateCallback iu){
#ifdef SE
  return NULL;
#else
  I*i=make(n,t,r,l,e,m,2); if(i){ i->ev=ev; i->early=early; } return i;
#endif
}
fmi3Instance fmi3InstantiateScheduledExecution(fmi3String n,fmi3String t,fmi3String r,fmi3Boolean v,fmi3Boolean l,fmi3InstanceEnvironment e,fmi3LogMessageCallback m,fmi3ClockUpdateCallback cu,fmi3LockPreemptionCallback lo,fmi3UnlockPreemptionCallback un){
#ifndef SE
  return NULL;
#else
  I*i=make(n,t,r,l,e,m,3); if(i){ i->lock=lo; i->unlock=un; } return i;
#endif
}
void fmi3FreeInstance(fmi3Instance c){ free(c); }
fmi3Status fmi3SetDebugLogging(fmi3Instance c,fmi3Boolean on,size_t n,const fmi3String k[]){ ((I*)c)->logging=on; return OK; }
static int isfull(Vals*v){ return v->h>=0.6; }
fmi3Status fmi3EnterInitializationMode(fmi3Instance c,fmi3Boolean td,fmi3Float64 tol,fmi3Float64 t,fmi3Boolean sd,fmi3Float64 stop){ I*i=c; if(i->mode!=INST) return bad(i,"wrong state"); i->mode=INIT; i->v.time=t;
  i->v.next=t+0.25;
  return OK; }
fmi3Status fmi3ExitInitializationMode(fmi3Instance c){ I*i=c; if(i->mode!=INIT) return bad(i,"wrong state"); Vals*v=&i->v; v->d=v->h; v->s2=10*v->sel; v->full=isfull(v); v->derc=v->k*(v->u-v->h); memcpy(v->echo,v->blob,v->nblob); v->necho=v->nblob;
#ifdef FAULT_traps
  feenableexcept(FE_DIVBYZERO|FE_INVALID);
#endif
  i->mode= i->kind==3?ACT: i->kind==1||i->ev?EVENT:STEP; return OK; }
fmi3Status fmi3EnterEventMode(fmi3Instance c){ I*i=c; if(!(i->mode&(CONT|STEP))||(i->mode==STEP&&!i->ev)) return bad(i,"wrong state"); i->mode=EVENT;
  return OK; }
fmi3Status fmi3Terminate(fmi3Instance c){ I*i=c; if(!(i->mode&(EVENT|CONT|STEP|ACT))) return bad(i,"wrong state"); i->mode=TERM; return OK; }
fmi3Status fmi3Reset(fmi3Instance c){ I*i=c; start(i); i->mode=INST; return OK; }
static double pend(Vals*v){ return v->clk? v->sum+v->uf : v->sum; }
fmi3Status fmi3GetFloat64(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Float64 x[],size_t nx){ I*i=c; Vals*v=&i->v; size_t p=0;
  for(size_t j=0;j<n;j++){ if(p>=nx) return bad(i,"too few values"); switch(vr[j]){ case 0:x[p++]=v->time;break;
#ifndef SE
    case 1:x[p++]=v->h;break; case 2:x[p++]=v->derc=v->k*(v->u-v->h);break; case 3:x[p++]=v->k;break; case 4:x[p++]=v->g;break; case 5:x[p++]=v->u;break; case 6:x[p++]=v->g*v->h*v->scale;break;
    case 7:x[p++]=i->mode<=INIT?v->h:v->d;
      break; case 8:x[p++]=2*v->k;break;
    case 9: if(p+3>nx) return bad(i,"too few values");
      x[p++]=v->h;x[p++]=2*v->h;x[p++]=3*v->h;break;
#else
    case 23:x[p++]=v->ts;break;
#endif
    case 30:x[p++]=v->h-0.6;break; case 21:x[p++]=v->uf;break; case 22:x[p++]=pend(v);break; default:return bad(i,"unknown Float64"); } }
  return p==nx?OK:bad(i,"too many values"); }
fmi3Status fmi3SetFloat64(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const fmi3Float64 x[],size_t nx){ I*i=c; Vals*v=&i->v; if(nx!=n) return bad(i,"wrong number"); if(i->mode==TERM) return bad(i,"terminated");
  for(size_t j=0;j<n;j++) switch(vr[j]){
#ifndef SE
    case 1: if(i->mode>INIT) return bad(i,"h is set before"); v->h=x[j];break; case 3: if(i->mode>INIT) return bad(i,"k is fixed"); v->k=x[j];break; case 4: if(i->mode&(CONT)||(i->mode==STEP&&i->ev)) return bad(i,"g is tunable in event mode"); v->g=x[j];break; case 5:v->u=x[j];break;
#endif
    case 21: if(i->mode&(CONT|STEP)) return bad(i,"uf is clocked"); v->uf=x[j];break; default:return bad(i,"this Float64 cannot be set"); } return OK; }
fmi3Status fmi3GetInt32(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Int32 x[],size_t nx){ I*i=c; Vals*v=&i->v; if(nx!=n) return bad(i,"wrong number"); for(size_t j=0;j<n;j++) switch(vr[j]){
#ifndef SE
  case 10:x[j]=v->n;break; case 11:x[j]=v->sel;break; case 12:x[j]=i->mode<=INIT?10*v->sel:v->s2;break;
#else
  case 20:x[j]=v->cs;break;
#endif
  case 18:x[j]=v->clk?v->c+1:v->c;break; default:return bad(i,"unknown Int32"); } return OK; }
fmi3Status fmi3SetInt32(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const fmi3Int32 x[],size_t nx){ I*i=c; for(size_t j=0;j<n;j++)
#ifndef SE
  if(vr[j]==11){ if(i->mode&(CONT|TERM)||(i->mode==STEP&&i->ev)) return bad(i,"sel is discrete"); i->v.sel=x[j]; } else
#endif
  return bad(i,"this Int32 cannot be set"); return OK; }
fmi3Status fmi3GetBoolean(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Boolean x[],size_t nx){ I*i=c; for(size_t j=0;j<n;j++)
#ifndef SE
  if(vr[j]==13) x[j]=i->mode<=INIT?isfull(&i->v):i->v.full; else
#endif
  return bad(i,"unknown Boolean"); return OK; }
fmi3Status fmi3SetBoolean(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const fmi3Boolean x[],size_t nx){ return n?bad(c,"none"):OK; }
fmi3Status fmi3GetString(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3String x[],size_t nx){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==14) x[j]=i->v.label; else return bad(i,"unknown String"); return OK; }
fmi3Status fmi3SetString(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const fmi3String x[],size_t nx){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==14){ if(i->mode>INIT) return bad(i,"label is fixed"); snprintf(i->v.label,64,"%s",x[j]?x[j]:""); } else return bad(i,"unknown String"); return OK; }
fmi3Status fmi3GetBinary(fmi3Instance c,const fmi3ValueReference vr[],size_t n,size_t s[],fmi3Binary x[],size_t nx){ I*i=c; Vals*v=&i->v; for(size_t j=0;j<n;j++) switch(vr[j]){ case 15:x[j]=v->blob;s[j]=v->nblob;break; case 16: if(i->mode<=INIT){x[j]=v->blob;s[j]=v->nblob;} else {x[j]=v->echo;s[j]=v->necho;} break; default:return bad(i,"unknown Binary"); } return OK; }
fmi3Status fmi3SetBinary(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const size_t s[],const fmi3Binary x[],size_t nx){ I*i=c; Vals*v=&i->v; for(size_t j=0;j<n;j++) if(vr[j]==15){ if(i->mode&(CONT|TERM)||(i->mode==STEP&&i->ev)) return bad(i,"blob is discrete"); if(s[j]>256) return bad(i,"blob is too large");
#ifdef FAULT_ends_at_zero
  v->nblob=strnlen((const char*)x[j],s[j]); memset(v->blob,0,256); memcpy(v->blob,x[j],v->nblob);
#else
  memcpy(v->blob,x[j],s[j]); v->nblob=s[j];
#endif
  } else return bad(i,"this Binary cannot be set"); return OK; }
fmi3Status fmi3GetClock(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Clock x[]){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==17) x[j]=i->v.clk; else return bad(i,"unknown Clock"); return OK; }
fmi3Status fmi3SetClock(fmi3Instance c,const fmi3ValueReference vr[],size_t n,const fmi3Clock x[]){ I*i=c; if(i->mode!=EVENT) return bad(i,"clocks are set in event mode"); for(size_t j=0;j<n;j++) if(vr[j]==17) { if(x[j]) i->v.clk=1; } else return bad(i,"unknown Clock"); return OK; }
static double period(I*i,fmi3ValueReference r){
  if(r==17) return 0.1;
#ifdef SE
  if(r==19) return 0.3;
#endif
  return -1; }
fmi3Status fmi3GetIntervalDecimal(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Float64 x[],fmi3IntervalQualifier q[]){ for(size_t j=0;j<n;j++){ double p=period(c,vr[j]); if(p<0) return bad(c,"unknown Clock"); x[j]=p; q[j]=fmi3IntervalUnchanged; } return OK; }
fmi3Status fmi3GetShiftDecimal(fmi3Instance c,const fmi3ValueReference vr[],size_t n,fmi3Float64 x[]){ for(size_t j=0;j<n;j++){ if(period(c,vr[j])<0) return bad(c,"unknown Clock"); x[j]=0; } return OK; }
typedef struct { Vals v; int mode; } S;
fmi3Status fmi3GetFMUState(fmi3Instance c,fmi3FMUState*s){ I*i=c; if(!*s) *s=calloc(1,sizeof(S)); S*q=*s; q->v=i->v; q->mode=i->mode; return OK; }
fmi3Status fmi3SetFMUState(fmi3Instance c,fmi3FMUState s){ I*i=c; S*q=s; if(!q) return bad(i,"no state"); i->v=q->v; i->mode=q->mode;
  return OK; }
fmi3Status fmi3FreeFMUState(fmi3Instance c,fmi3FMUState*s){ if(s&&*s){free(*s);*s=NULL;} return OK; }
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance c,fmi3FMUState s,size_t*n){*n=sizeof(S);return OK;}
fmi3Status fmi3SerializeFMUState(fmi3Instance c,fmi3FMUState s,fmi3Byte b[],size_t n){ if(n<sizeof(S)) return bad(c,"too small"); memcpy(b,s,sizeof(S));
  return OK; }
fmi3Status fmi3DeserializeFMUState(fmi3Instance c,const fmi3Byte b[],size_t n,fmi3FMUState*s){ if(n!=sizeof(S)) return bad(c,"wrong size"); if(!*s)*s=calloc(1,sizeof(S)); memcpy(*s,b,n);
  return OK; }
static void sample(Vals*v){ v->n++; v->d=v->h; v->next+=0.25; }
static void relax(I*i,double dt){ Vals*v=&i->v;
  v->h=v->u+(v->h-v->u)*exp(-v->k*dt); v->time+=dt; }
fmi3Status fmi3UpdateDiscreteStates(fmi3Instance c,fmi3Boolean*need,fmi3Boolean*term,fmi3Boolean*nom,fmi3Boolean*val,fmi3Boolean*def,fmi3Float64*next){ I*i=c; Vals*v=&i->v; if(i->mode!=EVENT) return bad(i,"wrong state"); *need=*term=*nom=*val=0;
  while(v->next<=v->time+1e-9) sample(v);
  if(v->clk){ v->sum+=v->uf; v->c++; v->clk=0; }
#ifdef FAULT_counts_updates
  else v->c++;
#endif
  v->s2=10*v->sel; v->full=isfull(v); memcpy(v->echo,v->blob,v->nblob); v->necho=v->nblob; *def=1; *next=v->next; return OK; }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance c){ I*i=c; return i->mode&(EVENT|INIT)?OK:bad(i,"wrong state"); }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance c){ I*i=c; if(i->mode!=EVENT||i->kind!=1) return bad(i,"wrong state"); i->mode=CONT;
  return OK; }
fmi3Status fmi3EnterStepMode(fmi3Instance c){ I*i=c; if(i->mode!=EVENT||i->kind!=2) return bad(i,"wrong state"); i->mode=STEP; return OK; }
fmi3Status fmi3CompletedIntegratorStep(fmi3Instance c,fmi3Boolean ns,fmi3Boolean*e,fmi3Boolean*t){ I*i=c; if(i->mode!=CONT) return bad(i,"wrong state"); *e=*t=0; return OK; }
fmi3Status fmi3SetTime(fmi3Instance c,fmi3Float64 t){ I*i=c; if(!(i->mode&(CONT|EVENT))||i->kind!=1) return bad(i,"wrong state"); i->v.time=t; return OK; }
fmi3Status fmi3SetContinuousStates(fmi3Instance c,const fmi3Float64 x[],size_t n){ I*i=c; if(i->mode!=CONT||n!=1) return bad(i,"wrong state"); i->v.h=x[0];
  return OK; }
fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance c,fmi3Float64 x[],size_t n){ I*i=c; Vals*v=&i->v; if(n!=1) return bad(i,"wrong number"); x[0]=v->k*(v->u-v->h);
#ifdef FAULT_late_rates
  x[0]=v->derc;
#endif
  return OK; }
fmi3Status fmi3GetEventIndicators(fmi3Instance c,fmi3Float64 z[],size_t n){ I*i=c; if(n!=1) return bad(i,"wrong number"); z[0]=i->v.h-0.6;
#ifdef FAULT_late_rates
  i->v.derc=i->v.k*(i->v.u-i->v.h);
#endif
  return OK; }
fmi3Status fmi3GetContinuousStates(fmi3Instance c,fmi3Float64 x[],size_t n){ if(n!=1) return bad(c,"wrong number"); x[0]=((I*)c)->v.h; return OK; }
fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance c,fmi3Float64 x[],size_t n){ if(n!=1) return bad(c,"wrong number"); x[0]=1; return OK; }
fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance c,size_t*n){*n=1;return OK;}
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance c,size_t*n){*n=1;return OK;}
fmi3Status fmi3DoStep(fmi3Instance c,fmi3Float64 t,fmi3Float64 hh,fmi3Boolean ns,fmi3Boolean*en,fmi3Boolean*term,fmi3Boolean*early,fmi3Float64*last){ I*i=c; Vals*v=&i->v; if(i->mode!=STEP) return bad(i,"wrong state"); *en=*term=*early=0; *last=v->time;
  if(hh<=0) return bad(i,"the step must be positive"); if(fabs(t-v->time)>1e-9*(1+fabs(t))) return bad(i,"not the time of the slave"); double end=t+hh;
#ifdef FAULT_counts_steps
  v->c++;
#endif
  if(!i->ev){ v->s2=10*v->sel; memcpy(v->echo,v->blob,v->nblob); v->necho=v->nblob; while(v->next<=end+1e-9){ if(v->next>v->time) relax(i,v->next-v->time); sample(v); } if(end>v->time) relax(i,end-v->time); v->time=end; v->full=isfull(v); }
  else { if(i->early && v->next<end-1e-9){ double s=v->next>v->time?v->next:v->time; if(s>v->time) relax(i,s-v->time); v->time=s; *early=1; *en=1; }
    else { if(end>v->time) relax(i,end-v->time); v->time=end; *en = v->next<=end+1e-9 || v->full!=isfull(v); } }
  *last=v->time; return OK; }
fmi3Status fmi3ActivateModelPartition(fmi3Instance c,fmi3ValueReference r,fmi3Float64 t){ I*i=c; Vals*v=&i->v; if(i->mode!=ACT) return bad(i,"wrong state");
  if(i->lock) i->lock();
  v->time=t;
#ifdef FAULT_thread_memory
  if(!begun) v->uf=0;
#endif
  if(r==17){ v->c++; v->sum+=v->uf;
#ifdef FAULT_crosses_partitions
    if(v->c%3==0) v->cs++;
#endif
#ifdef FAULT_rounds_down
    fesetround(FE_DOWNWARD);
#endif
  } else if(r==19){ v->cs++; v->ts=t; memcpy(v->echo,v->blob,v->nblob); v->necho=v->nblob;
  } else {
#ifndef FAULT_any_clock
    if(i->unlock) i->unlock(); return bad(i,"unknown Clock");
#endif
  }
  if(i->unlock) i->unlock(); return OK; }
#define NO(N,P) fmi3Status fmi3##N P { return bad(c,"not provided"); }
#define FAM(N,T) fmi3Status fmi3Get##N(fmi3Instance c,const fmi3ValueReference v[],size_t n,T x[],size_t m){return n?bad(c,"no " #N):OK;} fmi3Status fmi3Set##N(fmi3Instance c,const fmi3ValueReference v[],size_t n,const T x[],size_t m){return n?bad(c,"no " #N):OK;}
FAM(Float32,fmi3Float32) FAM(Int8,fmi3Int8) FAM(UInt8,fmi3UInt8) FAM(Int16,fmi3Int16) FAM(UInt16,fmi3UInt16) FAM(UInt32,fmi3UInt32) FAM(Int64,fmi3Int64) FAM(UInt64,fmi3UInt64)
NO(GetNumberOfVariableDependencies,(fmi3Instance c,fmi3ValueReference v,size_t*n)) NO(GetVariableDependencies,(fmi3Instance c,fmi3ValueReference d,size_t a[],fmi3ValueReference b[],size_t e[],fmi3DependencyKind k[],size_t n))
NO(GetDirectionalDerivative,(fmi3Instance c,const fmi3ValueReference u[],size_t nu,const fmi3ValueReference k[],size_t nk,const fmi3Float64 s[],size_t ns,fmi3Float64 x[],size_t nx)) NO(GetAdjointDerivative,(fmi3Instance c,const fmi3ValueReference u[],size_t nu,const fmi3ValueReference k[],size_t nk,const fmi3Float64 s[],size_t ns,fmi3Float64 x[],size_t nx))
NO(EnterConfigurationMode,(fmi3Instance c)) NO(ExitConfigurationMode,(fmi3Instance c))
NO(GetIntervalFraction,(fmi3Instance c,const fmi3ValueReference v[],size_t n,fmi3UInt64 a[],fmi3UInt64 b[],fmi3IntervalQualifier q[])) NO(GetShiftFraction,(fmi3Instance c,const fmi3ValueReference v[],size_t n,fmi3UInt64 a[],fmi3UInt64 b[]))
NO(SetIntervalDecimal,(fmi3Instance c,const fmi3ValueReference v[],size_t n,const fmi3Float64 x[])) NO(SetIntervalFraction,(fmi3Instance c,const fmi3ValueReference v[],size_t n,const fmi3UInt64 a[],const fmi3UInt64 b[]))
NO(SetShiftDecimal,(fmi3Instance c,const fmi3ValueReference v[],size_t n,const fmi3Float64 x[])) NO(SetShiftFraction,(fmi3Instance c,const fmi3ValueReference v[],size_t n,const fmi3UInt64 a[],const fmi3UInt64 b[]))
NO(GetOutputDerivatives,(fmi3Instance c,const fmi3ValueReference v[],size_t n,const fmi3Int32 o[],fmi3Float64 x[],size_t m))
