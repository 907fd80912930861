//! Content hashes: what tells two versions of a part, or of a whole scene, apart.

use super::{Environment, Scene};

/// 128-bit hash of a part's content. Equal content has equal hashes in every run and on every platform.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ContentHash(pub u128);

impl ContentHash {
    /// Hashes a sequence of byte slices; the boundaries between them count.
    pub fn of(parts: &[&[u8]]) -> Self {
        parts.iter().fold(Self(0xcbf2_9ce4_8422_2325_9ae1_6a3b_2f90_404f), |hash, part| hash.mix(part))
    }

    /// This hash with further bytes mixed in.
    #[must_use]
    pub fn mix(self, bytes: &[u8]) -> Self {
        const MULTIPLIER: u128 = 0x0fc9_4e3b_f4e9_ab32_8662_0d8e_d6b7_f1c5;
        let mut state = self.0 ^ (bytes.len() as u128).wrapping_mul(MULTIPLIER);
        for chunk in bytes.chunks(16) {
            let mut word = [0; 16];
            word[..chunk.len()].copy_from_slice(chunk);
            state = (state ^ u128::from_le_bytes(word)).wrapping_mul(MULTIPLIER);
            state ^= state >> 71;
        }
        state = state.wrapping_mul(MULTIPLIER);
        Self(state ^ (state >> 64))
    }
}

impl std::str::FromStr for ContentHash {
    type Err = std::num::ParseIntError;

    /// Reads what `Display` writes: 32 hexadecimal digits.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        u128::from_str_radix(text, 16).map(Self)
    }
}

impl std::fmt::Display for ContentHash {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:032x}", self.0)
    }
}

impl Scene {
    /// Hash of all that the scene's films depend on; names count too. Equal for equal scenes in every run of one version
    /// of the program. The cameras count because the split of light samples is measured from them.
    pub fn content_hash(&self) -> ContentHash {
        let parts = self.meshes.iter().map(|mesh| mesh.hash).chain(self.textures.iter().map(|texture| texture.hash));
        let parts: Vec<u8> = parts.flat_map(|hash| hash.0.to_le_bytes()).collect();
        let environment = match &self.environment {
            Environment::Constant(radiance) => format!("{radiance:?}"),
            Environment::Image { image, rotation_deg, intensity } => {
                format!("{} {rotation_deg:?} {intensity:?}", image.hash)
            }
        };
        // Debug prints floats so that they read back exactly: different values have different texts.
        let rest = format!("{:?} {:?} {:?} {:?}", self.materials, self.instances, self.lights, self.cameras);
        let hash = ContentHash::of(&[&parts, environment.as_bytes(), rest.as_bytes()]);
        self.backdrop.color().map_or(hash, |color| hash.mix(format!("{color:?}").as_bytes()))
    }
}
