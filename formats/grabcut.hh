/* GrabCut (Rother et al. 2004) as cv::grabCut has it, with what is decided
 * left out of the graph. */
#ifndef SPID_FORMATS_GRABCUT_HH
#define SPID_FORMATS_GRABCUT_HH

#include <opencv2/core.hpp>

/* label (CV_8U): cv::GC_BGD and GC_FGD stay, GC_PR_BGD and GC_PR_FGD are first
 * guesses and then what so many rounds find for rgb (CV_8UC3, of its size).
 * cv::theRNG seeds it.  Both kinds of pixels must be there. */
void grabcut_run(cv::Mat &label, const cv::Mat &rgb, int rounds);

#endif
