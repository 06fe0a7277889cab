unsafe extern "C" {
    fn clock_gettime(id: i32, t: *mut [i64; 2]) -> i32;
}
fn cpu() -> u64 {
    let mut t = [0i64; 2];
    unsafe { clock_gettime(3, &mut t) };
    (t[0] * 1_000_000_000 + t[1]) as u64
}
use zerre::Time;
use zerre::belief::Gaussian;
use zerre::filter::{Filter, ParticleFilter, Settings};
use zerre::kernels::{Generator, NoiseSource, Resolution, Simd, Threads};
use zerre::model::measurement::RangeBearing;
use zerre::model::motion::ConstantVelocity;
use zerre::rng::Stream;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let dir = "/work/shared/peers/data";
    let read = |f: &str| -> Vec<Vec<f64>> {
        std::fs::read_to_string(format!("{dir}/{f}"))
            .unwrap()
            .lines()
            .map(|l| l.split(',').map(|c| c.parse().unwrap()).collect())
            .collect()
    };
    let (data, reference) = (read("W1.csv"), read("W1_ref.csv"));
    let n: usize = a[1].parse().unwrap();
    let reps: usize = a.get(2).map_or(7, |s| s.parse().unwrap());
    for simd in Simd::available() {
        if let Some(s) = a.get(3) {
            if s != simd.name() {
                continue;
            }
        }
        for generator in [Generator::Philox, Generator::Xoshiro] {
            if a.len() > 4 && generator != Generator::Philox {
                continue;
            }
            for resolution in [Resolution::Bits32, Resolution::Bits64] {
                if a.len() > 4 && resolution != Resolution::Bits32 {
                    continue;
                }
                if simd.name() == "scalar" && n > 10000 {
                    continue;
                }
                let settings = Settings {
                    particles: n,
                    noise: NoiseSource { generator, resolution },
                    simd,
                    threads: Threads::Serial,
                    ..Settings::default()
                };
                let f = ParticleFilter::new(
                    Gaussian::independent([0.0, 0.0, 0.5, 0.3], [0.5, 0.5, 0.3, 0.3]).unwrap(),
                    ConstantVelocity::<2>::new(0.05).unwrap(),
                    RangeBearing::new([-6.0, 12.0], 0.1, 0.01).unwrap(),
                    settings,
                )
                .unwrap();
                let (mut ns, mut rmse, mut dref, mut ev) = (vec![], 0.0, 0.0, 0.0);
                for r in 0..reps {
                    let mut b = f.start(Time::ZERO, Stream::new(1000 + r as u64)).unwrap();
                    let t = cpu();
                    let (mut e, mut d) = (0.0, 0.0);
                    for (k, row) in data.iter().enumerate() {
                        let u = f.step(&mut b, Time::from_secs(k as f64), Some(&[row[4], row[5]])).unwrap();
                        ev += u.log_evidence / reps as f64;
                        let m = b.mean();
                        e += (m[0] - row[0]).powi(2) + (m[1] - row[1]).powi(2);
                        d += (m[0] - reference[k][0]).powi(2) + (m[1] - reference[k][1]).powi(2);
                    }
                    ns.push((cpu() - t) as f64 / (n as f64 * 100.0));
                    rmse += (e / 100.0).sqrt() / reps as f64;
                    dref += (d / 100.0).sqrt() / reps as f64;
                }
                ns.sort_by(f64::total_cmp);
                println!(
                    "{:7} {generator:?} {resolution:?} N={n} min {:.2} med {:.2} ns  rmse {rmse:.4} dref {dref:.5} ev {ev:.4}",
                    simd.name(),
                    ns[0],
                    ns[reps / 2]
                );
            }
        }
    }
}
