use zerre::resample::Resampling;
use zerre::rng::{Purpose, Stream};
unsafe extern "C" {
    fn clock_gettime(id: i32, t: *mut [i64; 2]) -> i32;
}
fn cpu() -> u64 {
    let mut t = [0i64; 2];
    unsafe { clock_gettime(3, &mut t) };
    (t[0] * 1_000_000_000 + t[1]) as u64
}
fn main() {
    let n: usize = std::env::args().nth(1).unwrap().parse().unwrap();
    let mut d = Stream::new(3).draws(Purpose::Other, 0, 0);
    let w: Vec<f64> = (0..n)
        .map(|_| {
            let a = d.normal();
            (-2.0 * a * a).exp()
        })
        .collect();
    let mut out = vec![0u32; n];
    for r in [
        Resampling::Systematic,
        Resampling::Systematic,
        Resampling::Systematic,
        Resampling::Systematic,
        Resampling::Systematic,
        Resampling::Systematic,
    ] {
        let mut t = vec![];
        let mut resampler = zerre::resample::Resampler::new(r).with(
            zerre::kernels::Simd::named(&std::env::args().nth(2).unwrap()).unwrap(),
            zerre::kernels::Threads::Serial,
        );
        for k in 0..200 {
            let a = cpu();
            resampler.ancestors(&w, Stream::new(1), k, &mut out).unwrap();
            t.push((cpu() - a) as f64 / n as f64);
        }
        t.sort_by(f64::total_cmp);
        println!("{r:?} N={n} min {:.2} med {:.2}", t[0], t[100]);
    }
}
