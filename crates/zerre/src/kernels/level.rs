//! Choice of the SIMD level at run time.

use fearless_simd::Level;

/// Instructions that the kernels use. They change the speed and never a bit of a result.
#[derive(Clone, Copy, Debug)]
pub struct Simd(pub(crate) Kind);

#[derive(Clone, Copy, Debug)]
pub(crate) enum Kind {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2(fearless_simd::Avx2),
    #[cfg(target_arch = "x86_64")]
    Avx512(fearless_simd::Avx512),
    #[cfg(target_arch = "aarch64")]
    Neon(fearless_simd::Neon),
}

impl Simd {
    /// No SIMD: the naive twins of the kernels, one particle after the other.
    pub fn scalar() -> Simd {
        Simd(Kind::Scalar)
    }

    /// All levels that this processor has, slowest first.
    pub fn available() -> Vec<Simd> {
        let mut levels = vec![Simd::scalar()];
        let best = Level::new();
        #[cfg(target_arch = "x86_64")]
        {
            levels.extend(best.as_avx2().map(|t| Simd(Kind::Avx2(t))));
            levels.extend(best.as_avx512().map(|t| Simd(Kind::Avx512(t))));
        }
        #[cfg(target_arch = "aarch64")]
        levels.extend(best.as_neon().map(|t| Simd(Kind::Neon(t))));
        levels
    }

    /// The fastest level that this processor has.
    pub fn best() -> Simd {
        let best = Level::new();
        #[cfg(target_arch = "x86_64")]
        {
            let avx512 = best.as_avx512().map(Kind::Avx512);
            avx512.or_else(|| best.as_avx2().map(Kind::Avx2)).map_or_else(Simd::scalar, Simd)
        }
        #[cfg(target_arch = "aarch64")]
        return best.as_neon().map(Kind::Neon).map_or_else(Simd::scalar, Simd);
        #[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
        Simd::scalar()
    }

    /// The level called `name` (`scalar`, `avx2`, `avx512`, `neon`) if this processor has it.
    pub fn named(name: &str) -> Option<Simd> {
        Simd::available().into_iter().find(|level| level.name() == name)
    }

    /// `scalar`, `avx2`, `avx512` or `neon`.
    pub fn name(self) -> &'static str {
        match self.0 {
            Kind::Scalar => "scalar",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2(_) => "avx2",
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512(_) => "avx512",
            #[cfg(target_arch = "aarch64")]
            Kind::Neon(_) => "neon",
        }
    }
}

/// Runs `$body` compiled for each SIMD level, with `$simd` bound to the level's token, and `$naive` without SIMD.
/// Everything that `$body` calls must be `#[inline(always)]`: what is not inlined is compiled without the level's
/// instructions.
macro_rules! dispatch {
    ($level:expr, $simd:ident => $body:expr, naive => $naive:expr) => {{
        #[allow(unused_imports, reason = "no SIMD level exists on some targets")]
        use fearless_simd::Simd as _;
        use $crate::kernels::level::Kind;
        match $level.0 {
            Kind::Scalar => $naive,
            #[cfg(target_arch = "x86_64")]
            Kind::Avx2($simd) => $simd.vectorize(
                #[inline(always)]
                || $body,
            ),
            #[cfg(target_arch = "x86_64")]
            Kind::Avx512($simd) => $simd.vectorize(
                #[inline(always)]
                || $body,
            ),
            #[cfg(target_arch = "aarch64")]
            Kind::Neon($simd) => $simd.vectorize(
                #[inline(always)]
                || $body,
            ),
        }
    }};
}
