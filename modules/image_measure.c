#include "image_measure.h"
