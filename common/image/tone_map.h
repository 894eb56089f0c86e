#pragma once

#include "common/image/image.h"

namespace trilha {

/// How light of any range is brought to what a screen shows.
enum class ToneMap { none, reinhard, aces };

/// Light times 2^exposure_stops, through a curve; light again. Takes light (Encoding::light). The curves give
/// [0, 1]: to them what lies below 0 is 0, and infinity is brighter than all else. NaN stays.
///
/// none      nothing but the exposure.
/// reinhard  Reinhard et al. 2002, equation 3: the luminance L (Rec. 709) becomes L/(1 + L), the ratios of
/// the
///           channels stay. A saturated colour may have a channel beyond 1 all the same: it is cut off there,
///           which changes the hue of what is both saturated and bright.
/// aces      Hill's fit of the ACES reference and output transforms for an sRGB screen (BakingLab, 2016). It
///           works in the wider primaries of ACES, so that bright saturated colours turn towards white as
///           film does; Narkowicz' fit of 2015, of one curve for each channel, cannot do that. No exposure is
///           built in: 0.18 becomes 0.11, 1 becomes 0.62.
Image tone_mapped(const Image& light, ToneMap tone_map, float exposure_stops = 0);

}  // namespace trilha
