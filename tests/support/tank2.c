/* A tank as an FMU of FMI 2.0, co-simulation and model exchange: dh/dt = k (u - h), sampled every 0.25 s.
 *
 * It is correct, or has the fault that a macro FAULT_... names. ONCE: one instance a process; RIPPLE: y has a ripple whose
 * period is a communication step, which is legal, and WARNS: steps return fmi2Warning. */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>
#include <stdio.h>
#include <math.h>
#include <fenv.h>
#include <locale.h>
#include <unistd.h>
#include <pthread.h>
#include <signal.h>
#include <fcntl.h>
#include "fmi2Functions.h"
#define OK fmi2OK
typedef enum { INST=1, INIT=2, EVENT=4, CONT=8, STEP=16, TERM=32, FAILED=64 } Mode;
typedef struct {
  double time, h, k, g, spare, u, d, next, scale, derc;
  int n, sel, s2, full;
  char label[64];
} Vals;
typedef struct { Vals v; fmi2CallbackFunctions cb; int logging, me, mode; char name[64]; char res[2048]; double scale0; } I;
#ifdef FAULT_shares_state
static double shared_h;
#endif
static void say(I*i, fmi2Status s, const char*m){ if(i->logging && i->cb.logger) i->cb.logger(i->cb.componentEnvironment,i->name,s,"logStatusAll",m); }
static fmi2Status bad(I*i,const char*m){ if(i->cb.logger) i->cb.logger(i->cb.componentEnvironment,i->name,fmi2Error,"logStatusError",m); return fmi2Error; }
#ifdef RIPPLE
#define RATE 104.71975511965977
static double ripple(double t) { return 0.05 * sin(RATE * t); }
static double slope(double t) { return 0.05 * RATE * cos(RATE * t); }
#else
static double ripple(double t) { return 0.0; }
static double slope(double t) { return 0.0; }
#endif
static void start(I*i){ Vals*v=&i->v; memset(v,0,sizeof *v); v->h=0.2; v->k=2; v->g=3; v->spare=1; v->u=1; v->sel=1; v->scale=i->scale0; strcpy(v->label,"tank"); v->next=0.25;
}
const char* fmi2GetTypesPlatform(void){return "default";}
const char* fmi2GetVersion(void){return "2.0";}
static int hexv(char c){ return c<='9'?c-'0':(c|32)-'a'+10; }
static double readscale(const char*uri){ char p[4096]; int j=0; const char*s=uri; double x=0;
  if(!strncmp(s,"file:",5)){ s+=5; if(!strncmp(s,"//",2)){ s+=2; while(*s && *s!='/') s++; } }
  for(;*s && j<4000;s++){
#ifndef FAULT_plain_uri
    if(*s=='%' && s[1] && s[2]){ p[j++]=(char)(hexv(s[1])*16+hexv(s[2])); s+=2; continue; }
#endif
    p[j++]=*s; }
  p[j]=0; strcat(p,"/scale.txt"); FILE*f=fopen(p,"r"); if(!f) return NAN; if(fscanf(f,"%lf",&x)!=1) x=NAN; fclose(f); return x; }
#ifdef ONCE
static int made;
#endif
fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String res, const fmi2CallbackFunctions*cb, fmi2Boolean vis, fmi2Boolean log){
  if(!name||!*name||!cb||!guid||strcmp(guid,GUID)) { if(cb&&cb->logger) cb->logger(cb->componentEnvironment,name?name:"",fmi2Error,"logStatusError","wrong guid or name"); return NULL; }
#ifdef ONCE
  if(made++) { cb->logger(cb->componentEnvironment,name,fmi2Error,"logStatusError","one instance a process"); return NULL; }
#endif
  I*i=calloc(1,sizeof *i); i->cb=*cb; i->logging=log; i->me=type==fmi2ModelExchange; i->mode=INST; snprintf(i->name,64,"%s",name);
  i->scale0=res?readscale(res):NAN; if(isnan(i->scale0)){ bad(i,"scale.txt cannot be read"); free(i); return NULL; }
#ifdef FAULT_changes_folder
  chdir("/");
#endif
  start(i); say(i,OK,"instantiated"); return i; }
void fmi2FreeInstance(fmi2Component c){ if(c) free(c); }
fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String cat[]){ ((I*)c)->logging=on; return OK; }
fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean td, fmi2Real tol, fmi2Real t, fmi2Boolean sd, fmi2Real stop){ I*i=c; if(i->mode!=INST) return bad(i,"setupExperiment in a wrong state"); i->v.time=t;
  i->v.next=t+0.25;
  return OK; }
fmi2Status fmi2EnterInitializationMode(fmi2Component c){ I*i=c; if(i->mode!=INST) return bad(i,"wrong state"); i->mode=INIT; return OK; }
static int isfull(Vals*v){ return v->h>=0.6; }
fmi2Status fmi2ExitInitializationMode(fmi2Component c){ I*i=c; if(i->mode!=INIT) return bad(i,"wrong state"); Vals*v=&i->v; v->d=v->h; v->s2=10*v->sel; v->full=isfull(v); v->derc=v->k*(v->u-v->h);
  i->mode=i->me?EVENT:STEP; return OK; }
fmi2Status fmi2Terminate(fmi2Component c){ I*i=c; if(!(i->mode&(EVENT|CONT|STEP))) return bad(i,"wrong state"); i->mode=TERM; return OK; }
fmi2Status fmi2Reset(fmi2Component c){ I*i=c; start(i); i->mode=INST; return OK; }
static double y(I*i){ return i->v.g*i->v.h*i->v.scale + ripple(i->v.time); }
fmi2Status fmi2GetReal(fmi2Component c,const fmi2ValueReference vr[],size_t n,fmi2Real x[]){ I*i=c; Vals*v=&i->v;
  for(size_t j=0;j<n;j++) switch(vr[j]){ case 0:x[j]=v->time;break; case 1:x[j]=v->h;break; case 2: v->derc=v->k*(v->u-v->h); x[j]=v->derc;break; case 3:x[j]=v->k;break; case 4:x[j]=v->g;break; case 5:x[j]=v->u;break;
    case 6:
#ifdef FAULT_reading_adds
      v->h+=1e-3;
#endif
      x[j]=y(i);
      break;
    case 7:x[j]=i->mode==INIT||i->mode==INST?v->h:v->d;
      break;
    case 8:x[j]=2*v->k*v->spare;break; case 9:x[j]=2*v->g;break; case 10:x[j]=v->spare;break; default:return bad(i,"unknown Real"); }
  return OK; }
fmi2Status fmi2GetInteger(fmi2Component c,const fmi2ValueReference vr[],size_t n,fmi2Integer x[]){ I*i=c; for(size_t j=0;j<n;j++) switch(vr[j]){case 0:x[j]=i->v.n;break;case 1:x[j]=i->v.sel;break;case 2:x[j]=i->mode<=INIT?10*i->v.sel:i->v.s2;break;default:return bad(i,"unknown Integer");} return OK; }
fmi2Status fmi2GetBoolean(fmi2Component c,const fmi2ValueReference vr[],size_t n,fmi2Boolean x[]){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==0) x[j]=i->mode<=INIT?isfull(&i->v):i->v.full; else return bad(i,"unknown Boolean"); return OK; }
fmi2Status fmi2GetString(fmi2Component c,const fmi2ValueReference vr[],size_t n,fmi2String x[]){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]<2) x[j]=i->v.label; else return bad(i,"unknown String"); return OK; }
fmi2Status fmi2SetReal(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2Real x[]){ I*i=c; Vals*v=&i->v;
  if(i->mode==TERM) return bad(i,"set after terminate");
  for(size_t j=0;j<n;j++) switch(vr[j]){
    case 1: if(i->mode>INIT) return bad(i,"h can be set before initialisation ends"); v->h=x[j]; break;
    case 3: if(i->mode>INIT) return bad(i,"k is fixed"); v->k=x[j];
      break;
    case 4: if(i->mode==CONT) return bad(i,"g is tunable in event mode"); v->g=x[j]; break;
    case 5: v->u=x[j]; break;
    case 10: if(i->mode>INIT) return bad(i,"spare is fixed"); v->spare=x[j]; break;
    default: return bad(i,"this Real cannot be set"); } return OK; }
fmi2Status fmi2SetInteger(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2Integer x[]){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==1){ if(i->mode==CONT||i->mode==TERM) return bad(i,"sel is discrete");
#ifdef FAULT_loses_switch
    if(i->mode==STEP && i->v.time>0) continue;
#endif
    i->v.sel=x[j]; } else return bad(i,"this Integer cannot be set"); return OK; }
fmi2Status fmi2SetBoolean(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2Boolean x[]){ return n?bad(c,"no Boolean can be set"):OK; }
fmi2Status fmi2SetString(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2String x[]){ I*i=c; for(size_t j=0;j<n;j++) if(vr[j]==0){ if(i->mode>INIT) return bad(i,"label is fixed"); snprintf(i->v.label,64,"%s",x[j]?x[j]:""); } else return bad(i,"this String cannot be set"); return OK; }
typedef struct { Vals v; int mode; } S;
fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate*s){ I*i=c; if(!*s) *s=calloc(1,sizeof(S)); S*q=*s; q->v=i->v; q->mode=i->mode; return OK; }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s){ I*i=c; S*q=s; if(!q) return bad(i,"no state");
  i->v=q->v; i->mode=q->mode;
  return OK; }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate*s){ if(s&&*s){ free(*s); *s=NULL; } return OK; }
fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s,size_t*n){ *n=sizeof(S); return OK; }
fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n){ if(n<sizeof(S)) return bad(c,"too small"); memcpy(b,s,sizeof(S));
  return OK; }
fmi2Status fmi2DeSerializeFMUstate(fmi2Component c,const fmi2Byte b[], size_t n, fmi2FMUstate*s){ if(n!=sizeof(S)) return bad(c,"wrong size"); if(!*s) *s=calloc(1,sizeof(S)); memcpy(*s,b,n);
  return OK; }
fmi2Status fmi2GetDirectionalDerivative(fmi2Component c,const fmi2ValueReference u[],size_t nu,const fmi2ValueReference k[],size_t nk,const fmi2Real dk[],fmi2Real du[]){ return bad(c,"not provided"); }
static void sample(Vals*v){ v->n++; v->d=v->h; v->next+=0.25;
}
static void relax(I*i,double dt){ Vals*v=&i->v;
#ifdef FAULT_logging_slows
  if(i->logging){ v->h+=dt*v->k*(v->u-v->h); v->time+=dt; return; }
#endif
  v->h=v->u+(v->h-v->u)*exp(-v->k*dt); v->time+=dt; }
fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean ns){ I*i=c; if(i->mode!=STEP) return bad(i,"doStep in a wrong state"); Vals*v=&i->v;
  if(h<=0) return bad(i,"the step must be positive"); if(fabs(t-v->time)>1e-9*(1+fabs(t))) return bad(i,"the communication point is not the time of the slave");
  double end=t+h; v->s2=10*v->sel;
  while(v->next<=end+1e-9){ if(v->next>v->time) relax(i,v->next-v->time); sample(v); }
  if(end>v->time) relax(i,end-v->time); v->time=end; v->full=isfull(v);
#ifdef FAULT_rounds_up
  fesetround(FE_UPWARD);
#endif
#ifdef WARNS
  return fmi2Warning;
#endif
  return OK; }
fmi2Status fmi2CancelStep(fmi2Component c){return bad(c,"no asynchronous step");}
fmi2Status fmi2SetRealInputDerivatives(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2Integer o[],const fmi2Real x[]){return bad(c,"not supported");}
fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c,const fmi2ValueReference vr[],size_t n,const fmi2Integer o[],fmi2Real x[]){ I*i=c; Vals*v=&i->v; double r=v->k*(v->u-v->h);
  for(size_t j=0;j<n;j++){ if(o[j]!=1||(vr[j]!=1&&vr[j]!=6)) return bad(i,"no such derivative"); x[j]=vr[j]==1?r:v->g*v->scale*r+slope(v->time); } return OK; }
fmi2Status fmi2GetStatus(fmi2Component c,const fmi2StatusKind k,fmi2Status*s){return fmi2Discard;}
fmi2Status fmi2GetRealStatus(fmi2Component c,const fmi2StatusKind k,fmi2Real*s){ if(k==fmi2LastSuccessfulTime){*s=((I*)c)->v.time;return OK;} return fmi2Discard;}
fmi2Status fmi2GetIntegerStatus(fmi2Component c,const fmi2StatusKind k,fmi2Integer*s){return fmi2Discard;}
fmi2Status fmi2GetBooleanStatus(fmi2Component c,const fmi2StatusKind k,fmi2Boolean*s){ if(k==fmi2Terminated){*s=0;return OK;} return fmi2Discard;}
fmi2Status fmi2GetStringStatus(fmi2Component c,const fmi2StatusKind k,fmi2String*s){return fmi2Discard;}
fmi2Status fmi2EnterEventMode(fmi2Component c){ I*i=c; if(!(i->mode&(CONT|EVENT))) return bad(i,"wrong state"); i->mode=EVENT;
#ifdef FAULT_counts_idle_events
  i->v.n++;
#endif
  return OK; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo*e){ I*i=c; Vals*v=&i->v; if(i->mode!=EVENT) return bad(i,"wrong state");
  memset(e,0,sizeof *e); while(v->next<=v->time+1e-9){
    sample(v); }
#ifdef FAULT_counts_updates
  v->d*=1.01;
#endif
  v->s2=10*v->sel; v->full=isfull(v); e->nextEventTimeDefined=1; e->nextEventTime=v->next; 
  return OK; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c){ I*i=c; if(i->mode!=EVENT) return bad(i,"wrong state"); i->mode=CONT;
  return OK; }
fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean ns, fmi2Boolean*ev, fmi2Boolean*term){ I*i=c; if(i->mode!=CONT) return bad(i,"wrong state"); *ev=0; *term=0;
#ifdef FAULT_needs_completed_steps
  i->v.scale = i->v.h>0.4? 2: i->v.scale;
#endif
  return OK; }
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real t){ I*i=c; if(!(i->mode&(CONT|EVENT))) return bad(i,"wrong state");
#ifdef FAULT_keeps_time
  if(t<i->v.time) return OK;
#endif
  i->v.time=t; return OK; }
fmi2Status fmi2SetContinuousStates(fmi2Component c,const fmi2Real x[],size_t n){ I*i=c; if(i->mode!=CONT||n!=1) return bad(i,"wrong state or number"); i->v.h=x[0];
#ifdef FAULT_shares_state
  shared_h=x[0];
#endif
  return OK; }
fmi2Status fmi2GetDerivatives(fmi2Component c,fmi2Real x[],size_t n){ I*i=c; Vals*v=&i->v; if(!(i->mode&(CONT|EVENT))||n!=1) return bad(i,"wrong state or number");
#ifdef FAULT_late_rates
  x[0]=v->derc; return OK;
#endif
#ifdef FAULT_shares_state
  x[0]=v->k*(v->u-(shared_h?shared_h:v->h)); return OK;
#endif
#ifdef FAULT_traps
  if(v->time>=0.3) feenableexcept(FE_DIVBYZERO);
#endif
#ifdef FAULT_takes_signals
  signal(SIGFPE,SIG_IGN);
#endif
  x[0]=v->k*(v->u-v->h); return OK; }
fmi2Status fmi2GetEventIndicators(fmi2Component c,fmi2Real z[],size_t n){ I*i=c; if(!(i->mode&(CONT|EVENT))||n!=1) return bad(i,"wrong state or number"); z[0]=i->v.h-0.6;
#ifdef FAULT_late_rates
  i->v.derc=i->v.k*(i->v.u-i->v.h);
#endif
  return OK; }
fmi2Status fmi2GetContinuousStates(fmi2Component c,fmi2Real x[],size_t n){ I*i=c; if(n!=1) return bad(i,"wrong number"); x[0]=i->v.h; return OK; }
fmi2Status fmi2GetNominalsOfContinuousStates(fmi2Component c,fmi2Real x[],size_t n){ if(n!=1) return bad(c,"wrong number"); x[0]=1; return OK; }
