//! x
use hysteron_plant::*;
use preset::*;
fn main(){
  for (f,lag,sec) in [(8000.0,72e-6,false),(2500.0,60e-6,true),(739.0,60e-6,true)] { 
   let c=|o| { let mut c=tracking_from(f,lag,sec,o); c.dac=None;c.sensor.adc=None;c.sensor.noise_rms_um=0.0;c};
   let (mut a,mut b)=(0.10,0.18);
   let h=|o| calibration::measured_openings(&c(o),0.0,26.0,0).unwrap();
   for _ in 0..5 { let (ha,hb)=(h(a)[0],h(b)[0]); let n=a+(0.1644-ha)/(hb-ha)*(b-a); a=b;b=n; if (b-a).abs()<1e-6 {break;} }
   println!("{f} {b} {:.4?} 30..130: {:.4?}",h(b),calibration::measured_openings(&c(b),30.0,130.0,0));
  }
    let c=tracking_739();
    let mut s=Stage::new(&c,1).unwrap(); let v=excitation::Excitation::samples(&excitation::Sine{frequency_hz:97.0,low_v:0.0,high_v:26.0,periods:1940.0},20e-6).unwrap();
    let t=std::time::Instant::now(); let r=s.run(&v,20e-6).unwrap(); println!("{} samples {:?}/sample {}",v.len(),t.elapsed()/v.len() as u32,r.position_um[5000]);
}
